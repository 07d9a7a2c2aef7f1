"""[[fmu]] and [[connection]]: FMUs of FMI 2.0 and 3.0 that are not ours, alone and beside ours."""

import math
import sys
import uuid
from pathlib import Path

import numpy as np
import pytest
import pythonfmu
from pythonfmu.builder import FmuBuilder

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.faults import SceneFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.fmi.units import SAME, Linear, Unit, conversion
from tests.orchestrator.foreign_fmus import (
    PAIR,
    SLAVE,
    edited,
    fmu_table,
    python_fmu,
    python_fmu_of,
    run,
    scene,
    wire_table,
    with_units,
)

SHIPPED = Path(pythonfmu.__file__).parent / "tests" / "slaves"


def shipped(folder: Path, name: str, *files: str) -> Path:
    """One of pythonfmu's example slaves as an FMU, with no trace of its build in this process."""
    before = set(sys.modules)
    made = FmuBuilder.build_FMU(
        SHIPPED / name, dest=folder, project_files=[SHIPPED / f for f in files]
    )
    for module in set(sys.modules) - before:
        del sys.modules[module]
    return Path(made)


STARTED = 'start = { intParam = 7, booleanParameter = true, stringParameter = "cat", realIn = 2 }\n'


def test_pythonfmus_examples_run_and_connect(tmp_path):
    shipped(tmp_path, "pythonslave.py")
    shipped(tmp_path, "slavewithdep.py", "localmodule.py")
    experiment, found = run(
        tmp_path,
        (
            "\n"
            + fmu_table(
                "clock",
                "PythonSlave",
                STARTED,
            )
            + fmu_table("decay", "PythonSlaveWithDep", "rate = 16\n")
            + wire_table("clock.realOut", "decay.realIn")
        ),
    )
    assert experiment.outcome.fault is None
    time = np.arange(33) / 64
    np.testing.assert_array_equal(found.haptics["clock.realOut"][1:], time[1:])
    slow = found.tables["16hz"]
    np.testing.assert_array_equal(slow["time"], np.arange(9) / 16)
    # y = u amplitude exp(t / tau), amplitude 5, tau .1, u = the clock at the start of the step
    starts, ends = np.arange(8) / 16, np.arange(1, 9) / 16
    u = np.concatenate([[3.0], starts[1:]])
    np.testing.assert_allclose(slow["decay.realOut"][1:], 5 * u * np.exp(ends / 0.1), rtol=1e-14)


STARTS = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String

class Starts(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.n, self.on, self.text, self.y = 0, False, "", 0.0
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        self.register_variable(Integer("n", **fixed))
        self.register_variable(Boolean("on", **fixed))
        self.register_variable(String("text", **fixed))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, size):
        self.y = self.n + 0.5 * self.on + int(self.text == "Maß = 3") * 100.0
        return True
"""


@pytest.mark.parametrize("isolate", ["", "isolate = true\n"])
def test_start_values_that_are_no_reals(tmp_path, isolate):
    python_fmu_of(tmp_path, STARTS, "starts")
    one = '[[fmu]]\nname = "one"\npath = "Starts.fmu"\n' + isolate
    starts = 'start = { n = -2147483648, on = true, text = "Maß = 3" }\n'
    for given, expected in ((starts, -(2.0**31) + 100.5), ("", 0.0)):
        experiment, found = run(tmp_path, one + given)
        assert experiment.outcome.fault is None
        assert found.haptics["one.y"][-1] == expected


THREE = """
import numpy
from pythonfmu3 import Boolean, Dimension, Float64, Fmi3Causality, Fmi3Slave
from pythonfmu3 import Fmi3Variability, Int32, UInt64

class Three(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.u, self.y = 0.0, numpy.zeros(3), numpy.zeros(3)
        self.n, self.f, self.on = 0, 0, False
        self.register_variable(Float64("time", causality=Fmi3Causality.independent,
                                       variability=Fmi3Variability.continuous))
        size = [Dimension(start="3")]
        self.register_variable(Float64("u", causality=Fmi3Causality.input, dimensions=size))
        self.register_variable(Float64("y", causality=Fmi3Causality.output, dimensions=size))
        self.register_variable(Int32("n", causality=Fmi3Causality.output))
        self.register_variable(UInt64("f", causality=Fmi3Causality.output))
        self.register_variable(Boolean("on", causality=Fmi3Causality.output))

    def set_float64(self, vrs, values):  # pythonfmu3 0.3's own fails on NumPy 2.3 and later
        self.u = numpy.array(values)

    def do_step(self, time, size):
        self.n += 1
        self.y, self.f, self.on = 2 * self.u + time + size, 3 * self.n, self.n % 2 == 1
        return True
"""


def three(folder: Path) -> Path:
    from pythonfmu3.builder import FmuBuilder as Builder3

    script = folder / "three_slave.py"
    script.write_text(THREE)
    return Path(Builder3.build_FMU(script, dest=folder))


def test_fmi3_arrays_and_types_beside_fmi2(tmp_path):
    pytest.importorskip("pythonfmu3")
    three(tmp_path)
    python_fmu(tmp_path, "Takes", "self.y = self.u + 10 * self.on")
    experiment, found = run(
        tmp_path,
        """
coupling = "jacobi"
[[fmu]]
name = "three"
path = "Three.fmu"
start.u = [1.0, 2.0, 3.0]
[[fmu]]
name = "takes"
path = "Takes.fmu"
[[connection]]
from = "three.n"
to = "takes.u"
[[connection]]
from = "three.on"
to = "takes.on"
[[connection]]
from = "takes.steps"
to = "three.u[2]"
""",
    )
    assert experiment.outcome.fault is None
    h, k = found.haptics, np.arange(33)
    assert describe(tmp_path / "Three.fmu").fmi == "3"
    np.testing.assert_array_equal(h["three.n"], k)
    np.testing.assert_array_equal(h["three.f"], 3 * k)
    np.testing.assert_array_equal(h["three.on"], k % 2)
    # What is connected is an entry of u; the others keep their start values.
    y = 2 * np.column_stack([np.ones(32), k[:-1], np.full(32, 3.0)]) + h["time"][1:, None]
    np.testing.assert_allclose(h["three.y"][1:], y, rtol=1e-15)
    np.testing.assert_array_equal(h["takes.y"][1:], k[:-1] + 10.0 * (k[:-1] % 2))


def test_dependencies_on_an_array_are_those_on_its_entries(tmp_path):
    pytest.importorskip("pythonfmu3")

    def declared(text):
        for reference, inputs in ((2, "1"), (3, "")):
            text = text.replace(
                f'<Output valueReference="{reference}"/>',
                f'<Output valueReference="{reference}" dependencies="{inputs}"/>',
            )
        return text

    found = describe(edited(three(tmp_path), declared))
    entry = found.port("u[2]", "input")
    assert len(entry) == 1
    follows = {s.name: found.follows(s, entry) for s in found.outputs}
    assert follows == {**{f"y[{i}]": True for i in (1, 2, 3)}, "n": False, "f": True, "on": True}


MANY = """self.value = {"u[1]": 0.0, "u[10]": 0.0, "u[2]": 0.0}
        for n in self.value:
            self.register_variable(Real(n, causality=Fmi2Causality.input,
                                        getter=lambda n=n: self.value[n],
                                        setter=lambda v, n=n: self.value.__setitem__(n, v)))"""


def test_a_vector_goes_by_its_indices_not_by_the_order_of_the_file(tmp_path):
    text = SLAVE.format(name="Listed", body="self.y = self.value['u[2]'] - self.value['u[10]']")
    text = text.replace('self.register_variable(Real("u", causality=Fmi2Causality.input))', MANY)
    python_fmu_of(tmp_path, text, "listed")
    found = describe(tmp_path / "Listed.fmu")
    assert [s.name for s in found.port("u", "input")] == ["u[1]", "u[2]", "u[10]"]
    fmu = '[[fmu]]\nname = "listed"\npath = "Listed.fmu"\nstart.u = [1.0, 2.0, 10.0]\n'
    assert run(tmp_path, fmu)[1].haptics["listed.y"][-1] == -8.0


DECAY = """
from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real

class Decay(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x, self.mode = 1.0, 1
        self.register_variable(Real("x", causality=Fmi2Causality.output,
                                    initial=Fmi2Initial.exact))
        self.register_variable(Integer("mode", causality=Fmi2Causality.parameter,
                                       variability=Fmi2Variability.fixed))

    def do_step(self, time, size):
        self.x *= 0.5 ** self.mode
        return True
"""
DECAY_FMU = '[[fmu]]\nname = "decay"\npath = "Decay.fmu"\n'
MODES = """<TypeDefinitions><SimpleType name="Mode"><Enumeration>
<Item name="slow" value="1"/><Item name="fast" value="3"/>
</Enumeration></SimpleType></TypeDefinitions>
<ModelVariables>"""


def decay(folder: Path) -> None:
    """x (an output with a start of its own) halves `mode` times a step; mode is slow or fast."""

    def enumerated(text: str) -> str:
        text = text.replace("<ModelVariables>", MODES)
        head, tail = text.split('name="mode"', 1)
        return (
            head + 'name="mode"' + tail.replace("<Integer", '<Enumeration declaredType="Mode"', 1)
        )

    edited(python_fmu_of(folder, DECAY, uuid.uuid4().hex), enumerated)


def test_states_take_their_start_and_enumerations_the_names_of_their_items(tmp_path):
    decay(tmp_path)
    for start, first, share in (('mode = "fast", x = 4', 4.0, 0.125), ("mode = 1", 1.0, 0.5)):
        x = run(tmp_path, f"{DECAY_FMU}start = {{ {start} }}\n")[1].haptics["decay.x"]
        np.testing.assert_array_equal(x, first * share ** np.arange(len(x)))


@pytest.mark.parametrize(
    ("start", "message"),
    [('mode = "fats"', "mode is one of slow, fast"), ("mode = 1.5", "mode takes a whole number")],
)
def test_items_that_an_enumeration_does_not_have(tmp_path, start, message):
    decay(tmp_path)
    found = findings(tmp_path, f"{DECAY_FMU}start = {{ {start} }}\n")
    assert message in found["fmu[0] (decay).start.mode"][1]


def test_a_filter_between_our_blocks_takes_the_place_of_a_connection(tmp_path):
    python_fmu(tmp_path, "Push", "self.y = 3.0")
    bar = """
[[fmu]]
name = "push"
path = "Push.fmu"
start.gain = 1
timing = "sampled"
[[connection]]
from = "push.y"
to = "virtual_mechanism.F_hand[1]"
[linkage]
operational_point = { body = "bar" }
[[linkage.body]]
name = "bar"
mass = 2.0
inertia = 0.01
[[linkage.joint]]
name = "slide"
type = "prismatic"
axis = 0.0
child = "bar"
"""
    experiment, found = run(tmp_path, bar)
    assert experiment.outcome.fault is None
    time = found.haptics["time"]
    x = found.haptics["virtual_mechanism.x"][:, 0]
    np.testing.assert_allclose(x, 0.75 * time**2, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("source", "target", "value", "expected"),
    [("mm", "m", 1500.0, 1.5), ("degC", "K", 20.0, 293.15), ("K", "degC", 273.15, 0.0),
     ("deg", "rad", 180.0, math.pi), ("m", "m", 2.0, 2.0)],
)  # fmt: skip
def test_units_convert(tmp_path, source, target, value, expected):
    with_units(python_fmu(tmp_path, "Gives", f"self.y = {value}"), y=source)
    with_units(python_fmu(tmp_path, "Takes", "self.y = self.u"), u=target)
    _, found = run(tmp_path, PAIR)
    np.testing.assert_allclose(found.haptics["takes.y"][-1], expected, rtol=1e-15, atol=1e-12)


def test_a_difference_of_temperatures_has_no_offset():
    base = (0, 0, 0, 0, 1, 0, 0, 0)
    degree, kelvin = Unit("degC", base, 1.0, 273.15), Unit("K", base)
    assert conversion(degree, kelvin) == Linear(1.0, 273.15)
    assert conversion(degree, kelvin, relative=True) == SAME
    assert Linear(2.0, 1.0).after(Linear(3.0, 5.0)) == Linear(6.0, 11.0)


def test_factor_and_offset_come_after_the_units(tmp_path):
    with_units(python_fmu(tmp_path, "Gives", "self.y = 1500.0"), y="mm")
    with_units(python_fmu(tmp_path, "Takes", "self.y = self.u"), u="m")
    _, found = run(tmp_path, PAIR + "factor = -2.0\noffset = 10.0\n")
    assert found.haptics["takes.y"][-1] == 7.0
    _, found = run(tmp_path, PAIR + "convert = false\n")
    assert found.haptics["takes.y"][-1] == 1500.0


def findings(folder: Path, text: str) -> dict[str, tuple[int | None, str]]:
    """(line, message) by key, of a scene that reading or building refuses."""
    with pytest.raises(SceneFault) as refused:
        simulate(str(scene(folder, text)), folder / "out")
    return {f.key: (f.line, f.message) for f in refused.value.findings}


@pytest.mark.parametrize(
    ("old", "new", "key", "line", "message"),
    [
        ('"gives.y"', '"gives.x"', "connection[0].from", 12, "no output 'x'"),
        ('"gives.y"', '"gives.u"', "connection[0].from", 12, "its causality is input"),
        ('"takes.u"', '"takes.y"', "connection[0].to", 13, "its causality is output"),
        ('"takes.u"', '"take.u"', "connection[0].to", 13, "did you mean 'takes'"),
        ('"takes.u"', '"takes"', "connection[0].to", 13, "write fmu.variable"),
        ("Gives.fmu", "Give.fmu", "fmu[0] (gives).path", 7, "there is no file"),
        ('"takes"', '"gives"', "fmu[1] (gives).name", 9, "is taken"),
        ("\n[[conn", "\nrate = 0\n[[conn", "fmu[1] (takes).rate", 11, "> 0"),
        ("\n[[conn", "\nrate = 'graphics'\n[[conn", "fmu[1] (takes).rate", 11, "no graphics rate"),
        ("\n[[conn", "\nstart.gan = 1\n[[conn", "fmu[1] (takes).start.gan", 11, "mean 'gain'"),
        ("\n[[conn", "\nstart.y = 1\n[[conn", "fmu[1] (takes).start.y", 11, "causality is output"),
        ("\n[[conn", "\nstart.y = 1\n[[conn", "fmu[1] (takes).start.y", 11, "one: u, on, gain"),
        ("\n[[conn", "\nstart.on = 1\n[[conn", "fmu[1] (takes).start.on", 11, "true or false"),
        ("\n[[conn", "\nstart.u = [1, 2]\n[[conn", "fmu[1] (takes).start.u", 11, "2 values"),
        ("\n[[conn", "\nsteps = 1\n[[conn", "fmu[1] (takes).steps", 11, "unknown key"),
        ("[[conn", "[[connection]]\nhold = 'zog'\n#", "connection[0].hold", 12, "did you mean"),
    ],
)  # fmt: skip
def test_faults_of_tables_have_their_place(tmp_path, old, new, key, line, message):
    python_fmu(tmp_path, "Gives")
    python_fmu(tmp_path, "Takes")
    found = findings(tmp_path, PAIR.replace(old, new, 1))
    assert key in found, found
    assert found[key][0] == line
    assert message in found[key][1]


def test_units_that_do_not_convert_are_refused_with_both(tmp_path):
    with_units(python_fmu(tmp_path, "Gives"), y="mm")
    with_units(python_fmu(tmp_path, "Takes"), u="rad")
    line, message = findings(tmp_path, PAIR)["connection[0]"]
    assert line == 11
    assert "y is in mm, u in rad: m is not rad" in message
    with_units(python_fmu(tmp_path, "Takes"), u="furlong")
    assert "furlong has no BaseUnit" in findings(tmp_path, PAIR)["connection[0]"][1]


def test_an_input_has_one_source(tmp_path):
    python_fmu(tmp_path, "Gives")
    python_fmu(tmp_path, "Takes")
    again = '[[connection]]\nfrom = "takes.y"\nto = "takes.u"\n'
    line, message = findings(tmp_path, PAIR + again)["connection[1].to"]
    assert line == 16
    assert "takes.u is fed by gives.y already" in message


def test_paths_are_relative_to_the_scene_file_and_options_reach_in(tmp_path):
    (tmp_path / "below").mkdir()
    python_fmu(tmp_path, "Gives")
    text = PAIR.split("[[connection]]")[0].replace("Gives.fmu", "../Gives.fmu")
    text = text.split('[[fmu]]\nname = "takes"')[0]
    path = scene(tmp_path / "below", text)
    read = open_scene.load(str(path), ["fmu.gives.rate=30"])
    assert Path(read.fmu[0].path).samefile(tmp_path / "Gives.fmu")
    assert read.fmu[0].rate == 30


TURNING = """
[[fmu]]
name = "slow"
path = "Slow.fmu"
rate = 16
[[fmu]]
name = "fast"
path = "Fast.fmu"
[[connection]]
from = "slow.y"
to = "fast.u"
[holds]
"slow.y" = "foh"
[kinds]
"slow.y" = "angle"
"""


def test_an_angle_in_degrees_is_continued_over_its_seam(tmp_path):
    """A turn of 400 degrees a second, wrapped: first order gives the line back."""
    body = "self.y = (400 * (time + size) + 180) % 360 - 180"
    with_units(python_fmu(tmp_path, "Slow", body), y="deg")
    with_units(python_fmu(tmp_path, "Fast", "self.y = self.u"), u="deg", y="deg")
    _, found = run(tmp_path, TURNING, "duration=2.0")
    time, seen = found.haptics["time"][12:], found.haptics["fast.y"][12:]
    # The value for the middle of the step that ends here.
    np.testing.assert_allclose(seen, 400 * (time - 0.5 / 64), rtol=0, atol=1e-8)


def test_what_is_no_angle_is_not_unwrapped(tmp_path):
    with_units(python_fmu(tmp_path, "Slow"), y="m")
    python_fmu(tmp_path, "Fast")
    with pytest.raises(SceneFault, match="in m, which is no angle"):
        run(tmp_path, TURNING)
