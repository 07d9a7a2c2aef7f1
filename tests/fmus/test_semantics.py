"""What every built FMU does through FMPy, whichever way it is packaged."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from hapticlink.components.component import Block, Variable
from hapticlink.components.specs.linkage import Mechanism
from hapticlink.fmus import fmu_functions
from hapticlink.fmus.blocks import component
from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.fmus.check import FmuSession, check_fmu, session
from tests.fmus import sample_components
from tests.fmus.named_fmu import Named
from tests.mechanisms import five_bar

BUILD = {"python": build, "native": build_native, "native3": partial(build_native, fmi=3)}
DISCARD, ERROR, FATAL = 2, 3, 4
# pythonfmu has no other answer to an exception.
REFUSED = {"python": FATAL, "native": ERROR, "native3": ERROR}
OUT_OF_STEP = {"python": DISCARD, "native": ERROR}


@pytest.fixture(params=BUILD)
def packaging(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def files(request: pytest.FixtureRequest, packaging: str) -> dict:
    made = {"python": "fmus", "native": "native_fmus", "native3": "native_fmus_3"}
    return request.getfixturevalue(made[packaging])


@pytest.fixture
def opened(files: dict) -> Iterator[Callable[[str], FmuSession]]:
    """name -> Session; closed at the end of the test."""
    with ExitStack() as stack:
        yield lambda name: stack.enter_context(session(files[name]))


@pytest.mark.parametrize("name", [c.name for c in sample_components.EVERY])
def test_contract(files, name):
    assert check_fmu(files[name]) == []


def test_continuous_block_follows_the_discrete_closed_form(opened):
    """Semi-implicit Euler of an oscillator: cos(theta) = 1 - (w h)^2 / 2 exactly.

    x_k = A cos(k theta) + B sin(k theta) with x_0 = 1 and x_1 = 1 - (w h)^2.
    """
    fmu, h, w = Named(opened("spring")).start(), 0.01, 2.0
    theta = math.acos(1 - (w * h) ** 2 / 2)
    b = (1 - (w * h) ** 2 - math.cos(theta)) / math.sin(theta)
    for k in range(1, 200):
        fmu.step((k - 1) * h, h)
        expected = math.cos(k * theta) + b * math.sin(k * theta)
        assert fmu.get("x[1]")[0] == pytest.approx(expected, abs=1e-12)
    assert fmu.get("time")[0] == pytest.approx(199 * h)


def test_outputs_on_request_are_left_out_while_nobody_reads_them(tmp_path, packaging, monkeypatch):
    """A reduced step that is marked by its x shows when it was taken: after four steps without a
    read, and at once where there were as many between the last two reads."""
    whole = fmu_functions._reduced

    def marked(*given):
        reduced = whole(*given)
        arguments = reduced.sx_in()
        x1, y, z = reduced(*arguments)
        y[0] += 1000.0
        names = reduced.name_in(), reduced.name_out()
        return ca.Function("reduced", arguments, [x1, y, z], *names)

    monkeypatch.setattr(fmu_functions, "_reduced", marked)
    block = Block(
        inputs=[Variable("u", start=1.0)],
        states=[Variable("x")],
        outputs=[Variable("x"), Variable("wave", on_request=True)],
    )
    x = block.x["x"]
    plant = block.component(
        "plant",
        "",
        "continuous",
        initial={"x": ca.SX(0)},
        step={"x": x + block.h * block.u["u"]},
        output={"x": x, "wave": ca.sin(ca.cos(x))},
    )
    taken = []
    with session(BUILD[packaging](plant, tmp_path)) as at:
        fmu = Named(at).start()
        for k in range(14):
            fmu.step(k / 8, 1 / 8)
            taken.append(fmu.get("x")[0] > 500.0)
            if k in (7, 8, 9, 10):
                x, wave = (k + 1) / 8, math.sin(math.cos((k + 1) / 8))
                assert fmu.get("wave", "x") == pytest.approx([wave, x], abs=1e-15)
    assert [k for k, reduced in enumerate(taken) if reduced] == [4, 5, 6, 7, 8]


@pytest.mark.parametrize("every", [1, 3, 5])
def test_which_outputs_are_read_when_changes_no_bit(tmp_path, packaging, every):
    """Neither after a step, nor after inputs were set, nor in a restored state."""
    block = component(
        "virtual_mechanism", {"linkage": five_bar(), "mechanism": Mechanism(integrator="heun")}
    )
    outputs = [name for v in block.outputs for name in v.names]
    path = BUILD[packaging](block, tmp_path)
    with session(path) as one, session(path) as other:
        always, rarely = Named(one).start(), Named(other).start()
        for k in range(24):
            for fmu in (always, rarely):
                fmu.set(**{"F_hand[1]": 0.1 * k})
                fmu.step(k / 512, 1 / 512)
            expected = always.get(*outputs)
            names = outputs if k % every == every - 1 else ["x[1]", "qd[2]", "closure_error"]
            assert rarely.get(*names) == [expected[outputs.index(name)] for name in names]
        saved = rarely.slave.getFMUState()
        assert rarely.slave.serializeFMUstate(saved) == always.slave.serializeFMUState(
            always.slave.getFMUState()
        )


def test_substeps_divide_the_step(tmp_path, packaging, opened):
    whole = Named(opened("spring")).start()
    for k in range(4):
        whole.step(k * 0.25, 0.25)
    divided = BUILD[packaging](sample_components.spring("divided", substeps=4), tmp_path)
    with session(divided) as at:
        divided = Named(at).start()
        divided.step(0.0, 1.0)
        assert divided.get("x[1]", "x[2]") == whole.get("x[1]", "x[2]")


def test_initialisation_follows_inputs_and_parameters(opened):
    fmu = Named(opened("spring"))
    fmu.slave.setupExperiment(startTime=3.0)
    fmu.slave.enterInitializationMode()
    assert fmu.get("x[1]", "a", "time") == [1.0, -4.0, 3.0]
    fmu.set(F=4.0)
    assert fmu.get("x[1]", "a") == [1.5, -4.0]
    fmu.set(k=16.0, m=1.0)
    assert fmu.get("x[1]", "a") == [1.25, -16.0]
    fmu.slave.exitInitializationMode()
    fmu.set(F=0.0)  # no longer moves the start, but a direct feed-through shows
    assert fmu.get("x[1]", "a") == [1.25, -20.0]


def test_fixed_parameters_hold_after_initialisation_tunable_ones_do_not(packaging, opened):
    at = opened("spring")
    fmu = Named(at).start()
    fmu.set(k=4.0)
    assert fmu.get("a") == [-2.0]
    with pytest.raises(FMICallException) as raised:
        fmu.set(m=1.0)
    assert raised.value.status == REFUSED[packaging]
    assert "parameter m is fixed" in " ".join(at.messages)
    assert fmu.get("m", "a") == [2.0, -2.0]


def test_outputs_cannot_be_set(opened):
    at = opened("spring")
    with pytest.raises(FMICallException):
        Named(at).start().set(a=1.0)
    assert "a is an output" in " ".join(at.messages)


def test_sampled_block_holds_the_output_of_its_start(opened):
    fmu = Named(opened("controller"))
    fmu.set(**{"e[1]": 1.0, "e[2]": 10.0})
    fmu.start(time=5.0)
    at_start = [1 * 1 + 2 * 10 + 5.0, 3 * 1 + 4 * 10 + 5.0]  # G row by row
    assert fmu.get("y[1]", "y[2]") == at_start
    fmu.set(**{"e[1]": 7.0})
    assert fmu.get("y[1]", "y[2]") == at_start
    fmu.set(**{"e[1]": 2.0, "G[1,2]": 0.0})
    fmu.step(5.0, 0.5)  # y of t = 5 with the inputs of t = 5, before the sum moves
    assert fmu.get("y[1]", "y[2]", "total[1]") == [2.0 + 5.0, 46.0 + 5.0, 0.0]
    fmu.step(5.5, 0.5)
    assert fmu.get("y[1]", "total[1]", "total[2]") == [2.0 + 2.0 + 5.5, 2.0, 10.0]


def test_values_in_any_order(opened):
    fmu = Named(opened("controller"))
    fmu.set(**{"G[2,2]": 9.0, "e[2]": 5.0, "G[1,1]": 8.0})
    assert fmu.get("G[1,1]", "e[2]", "G[2,2]", "G[1,2]", "e[2]") == [8.0, 5.0, 9.0, 2.0, 5.0]


def test_a_step_to_nan_keeps_the_last_good_state_and_names_it(opened):
    at = opened("fragile")
    fmu = Named(at).start()
    fmu.step(0.0, 0.1)
    before = fmu.get("count", "y[1]", "y[2]")
    fmu.set(u=100.0)
    with pytest.raises(FMICallException) as raised:
        fmu.step(0.1, 0.1)
    assert raised.value.status == DISCARD
    assert fmu.get("count", "y[1]", "y[2]") == before
    message = " ".join(at.messages)
    assert "r[2] became nan at t = 0.2" in message
    assert "smaller step" in message
    fmu.set(u=0.0)
    fmu.step(0.1, 0.1)  # and it goes on from there
    assert fmu.get("count", "y[2]") == [2.0, math.sqrt(before[2])]


def test_the_message_names_an_input_that_is_not_finite(opened):
    at = opened("spring")
    fmu = Named(at).start()
    fmu.set(F=math.inf)
    with pytest.raises(FMICallException):
        fmu.step(0.0, 0.1)
    assert "F = inf" in " ".join(at.messages)


def test_a_start_that_is_not_finite_ends_initialisation(opened):
    at = opened("spring")
    fmu = Named(at)
    fmu.set(F=math.nan)
    fmu.slave.setupExperiment()
    fmu.slave.enterInitializationMode()
    with pytest.raises(FMICallException):
        fmu.slave.exitInitializationMode()
    assert "state[1] became nan" in " ".join(at.messages)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.0, 5e-324])
def test_a_saved_state_holds_every_double(opened, value):
    fmu = Named(opened("controller")).start()
    fmu.set(**{"e[1]": value})
    state = fmu.slave.getFMUState()
    fmu.set(**{"e[1]": 1.0})
    saved = fmu.slave.serializeFMUstate(state)
    fmu.slave.freeFMUState(state)
    state = fmu.slave.deSerializeFMUstate(saved)
    fmu.slave.setFMUState(state)
    fmu.slave.freeFMUState(state)
    (back,) = fmu.get("e[1]")
    assert np.float64(back).tobytes() == np.float64(value).tobytes()


def test_a_state_saved_in_initialisation_mode_is_that_of_initialisation_mode(opened):
    fmu = Named(opened("spring"))
    fmu.slave.setupExperiment()
    fmu.slave.enterInitializationMode()
    state = fmu.slave.getFMUState()
    fmu.slave.exitInitializationMode()
    fmu.step(0.0, 0.1)
    fmu.slave.setFMUState(state)
    fmu.slave.freeFMUState(state)
    fmu.set(m=4.0, F=8.0)
    assert fmu.get("x[1]", "a") == [2.0, -2.0]


def test_a_state_of_another_fmu_is_refused(opened):
    spring, other = Named(opened("spring")).start(), Named(opened("controller")).start()
    state = spring.slave.getFMUState()
    saved = spring.slave.serializeFMUstate(state)
    spring.slave.freeFMUState(state)

    def restore() -> None:
        foreign = other.slave.deSerializeFMUstate(saved)  # a native FMU refuses here
        try:
            other.slave.setFMUState(foreign)
        finally:
            other.slave.freeFMUState(foreign)

    with pytest.raises(FMICallException):
        restore()
    assert "not saved by this FMU" in " ".join(other.at.messages)


def test_fmus_of_one_process_each_run_their_own_functions(tmp_path, packaging):
    """Same name, same shape, other equations; two instances of each in turn."""
    build = BUILD[packaging]
    first = build(sample_components.stateless("gain", 2.0), tmp_path / "a")
    second = build(sample_components.stateless("gain", 3.0), tmp_path / "b")
    with session(first) as one, session(second) as two:
        for at, factor in ((one, 2.0), (two, 3.0), (one, 2.0)):
            fmu = Named(at)
            fmu.set(u=5.0)
            fmu.start()
            fmu.step(0.0, 0.1)
            assert fmu.get("y") == [5.0 * factor]


SETUP = ("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
ENTER, EXIT = ("fmi2EnterInitializationMode",), ("fmi2ExitInitializationMode",)
STEP, TERMINATE = ("fmi2DoStep", 0.0, 0.1, 1), ("fmi2Terminate",)
START = (SETUP, ENTER, EXIT)


@pytest.mark.parametrize("packaging", ["python", "native"], indirect=True)
@pytest.mark.parametrize(
    ("before", "call", "mode"),
    [
        ((), STEP, "instantiated"),
        ((), EXIT, "instantiated"),
        ((), TERMINATE, "instantiated"),
        ((SETUP, ENTER), STEP, "in initialisation mode"),
        ((SETUP, ENTER), ENTER, "in initialisation mode"),
        ((SETUP, ENTER), TERMINATE, "in initialisation mode"),
        (START, SETUP, "initialised"),
        (START, ENTER, "initialised"),
        (START, EXIT, "initialised"),
        ((*START, STEP, TERMINATE), STEP, "terminated"),
        ((*START, STEP, TERMINATE), TERMINATE, "terminated"),
    ],
)
def test_calls_out_of_order_are_refused_and_change_nothing(opened, packaging, before, call, mode):
    """FMI 2.0.5 section 4.2.4."""
    at = opened("spring")
    fmu = Named(at)
    for name, *arguments in before:
        getattr(fmu.slave, name)(fmu.slave.component, *arguments)
    found = fmu.get("x[1]", "x[2]", "a", "time")
    with pytest.raises(FMICallException) as raised:
        getattr(fmu.slave, call[0])(fmu.slave.component, *call[1:])
    assert raised.value.status == (OUT_OF_STEP if call == STEP else REFUSED)[packaging]
    assert f"{call[0]} may not be called: the FMU is {mode}" in " ".join(at.messages)
    assert fmu.get("x[1]", "x[2]", "a", "time") == found


def test_nothing_is_set_after_the_end_and_reset_begins_again(opened):
    fmu = Named(opened("spring")).start()
    fmu.slave.terminate()
    with pytest.raises(FMICallException):
        fmu.set(F=1.0)
    fmu.slave.reset()
    fmu.set(F=8.0)
    fmu.start().step(0.0, 0.1)
    assert fmu.get("F") == [8.0]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_times_that_are_not_finite_are_refused(opened, value):
    fmu = Named(opened("spring"))
    with pytest.raises(FMICallException):
        fmu.start(value)
    fmu.start()
    before = fmu.get("x[1]", "x[2]", "time")
    for time, size in ((value, 0.1), (0.0, value), (1e308, 1e308)):
        with pytest.raises(FMICallException):
            fmu.step(time, size)
    assert "has no end" in " ".join(fmu.at.messages)
    assert fmu.get("x[1]", "x[2]", "time") == before


@pytest.mark.parametrize("name", ["spring", "gain"])
@pytest.mark.parametrize(
    ("time", "size", "why"),
    [
        (0.5, 0.0, "has no end after it"),
        (0.5, -0.25, "has no end after it"),
        (0.25, 0.25, "a step from t = 0.25 s: the FMU stands at 0.5 s"),
        (0.75, 0.25, "a step from t = 0.75 s: the FMU stands at 0.5 s"),
        (0.5, 0.75, "a step to t = 1.25 s, beyond the stop time 1.0 s"),
    ],
)
def test_steps_that_cannot_be_are_refused_and_change_nothing(
    opened, name, packaging, time, size, why
):
    fmu = Named(opened(name)).start(stop=1.0)
    fmu.step(0.0, 0.5)
    before = fmu.slave.getReal(fmu.at.reals)
    with pytest.raises(FMICallException) as raised:
        fmu.step(time, size)
    assert raised.value.status == OUT_OF_STEP.get(packaging, ERROR)
    assert why in " ".join(fmu.at.messages).replace("1 s", "1.0 s")
    assert fmu.slave.getReal(fmu.at.reals) == before
    fmu.step(0.5, 0.5)


def test_steps_whose_times_are_added_up_reach_the_stop_time(opened):
    fmu, time = Named(opened("spring")).start(stop=1.0), 0.0
    for _ in range(10):
        fmu.step(time, 0.1)
        time += 0.1
    assert time != 1.0
    assert fmu.get("time")[0] == pytest.approx(1.0)


def test_a_sampled_output_that_is_not_finite_fails_the_step(tmp_path, packaging):
    b = Block(inputs=[Variable("M", start=2.0)], states=[Variable("n")], outputs=[Variable("F")])
    made = b.component(
        "divides", "", "sampled", initial={"n": ca.SX(0)}, step={"n": b.x["n"] + 1},
        output={"F": 1 / b.u["M"] + b.x["n"]},
    )  # fmt: skip
    with session(BUILD[packaging](made, tmp_path)) as at:
        fmu = Named(at).start()
        fmu.step(0.0, 0.1)
        fmu.set(M=0.0)
        with pytest.raises(FMICallException) as raised:
            fmu.step(0.1, 0.1)
        assert raised.value.status == DISCARD
        assert "F became inf at t = 0.1; inputs and parameters are finite; look for an input " in (
            " ".join(at.messages)
        )
        assert fmu.get("F") == [0.5]
        fmu.set(M=4.0)
        fmu.step(0.1, 0.1)
        assert fmu.get("F") == [1.25]


def test_another_guid_is_refused(opened):
    """That of an FMU whose description is another's."""
    at = opened("spring")
    own, at.description.guid = at.description.guid, opened("gain").description.guid
    description = Path(at.folder, "modelDescription.xml")
    description.write_text(description.read_text().replace(own, at.description.guid))
    with pytest.raises(Exception, match="Failed to instantiate"):
        at.instance()
    assert own in " ".join(at.messages)
    at._instances.clear()
