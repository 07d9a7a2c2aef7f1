"""[[fmu]] and [[connection]]: FMUs of FMI 2.0 and 3.0 that are not ours, alone and beside ours."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
import pythonfmu
from pythonfmu.builder import FmuBuilder
from scipy.linalg import expm

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.fmi.units import SAME, Linear, Unit, conversion
from tests.little_fmus import edited, python_fmu, python_fmu_of, slave, with_units
from tests.orchestrator.foreign_scenes import ISOLATED, PAIR, fmu_table, ran, run, scene, wire_table
from tests.shared_fixtures import BAR

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
    decay = fmu_table("decay", "PythonSlaveWithDep", "rate = 16\n")
    wire = wire_table("clock.realOut", "decay.realIn")
    found = ran(tmp_path, fmu_table("clock", "PythonSlave", STARTED) + decay + wire)
    time = np.arange(33) / 64
    np.testing.assert_array_equal(found.haptics["clock.realOut"][1:], time[1:])
    slow = found.tables["16hz"]
    np.testing.assert_array_equal(slow["time"], np.arange(9) / 16)
    # y = u amplitude exp(t / tau), amplitude 5, tau .1, u = the clock at the start of the step
    starts, ends = np.arange(8) / 16, np.arange(1, 9) / 16
    u = np.concatenate([[3.0], starts[1:]])
    np.testing.assert_allclose(slow["decay.realOut"][1:], 5 * u * np.exp(ends / 0.1), rtol=1e-14)


@pytest.mark.parametrize("name", ["a,b", '"a", b', '"', '""', "'", ",',", "a b", "λ[1,2]"])
def test_any_name_comes_back_from_the_csv(tmp_path, name):
    """It shifts no column."""
    path = slave(tmp_path, "Gives", ("output", {"first": 6.0, "NAME": 7.0, "last": 8.0}))
    edited(path, lambda text: text.replace("NAME", name.replace('"', "&quot;")))
    found = ran(tmp_path, fmu_table("gives", "Gives")).haptics
    assert found.columns == ("time", "gives.first", f"gives.{name}", "gives.last")
    assert found.rows[-1, 1:].tolist() == [6.0, 7.0, 8.0]


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_start_values_that_are_no_reals(tmp_path, isolate):
    parameters = {"n": 0, "on": False, "text": ""}
    body = """values["y"] = values["n"] + 0.5 * values["on"]
        values["y"] += 100.0 * (values["text"] == "Maß = 3")"""
    slave(tmp_path, "Starts", ("parameter", parameters), ("output", {"y": 0.0}), body=body)
    starts = 'start = { n = -2147483648, on = true, text = "Maß = 3" }\n'
    for given, expected in ((starts, -(2.0**31) + 100.5), ("", 0.0)):
        found = ran(tmp_path, fmu_table("one", "Starts", isolate + given))
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
    return python_fmu_of(folder, THREE, "three_slave", "3")


def test_fmi3_arrays_and_types_beside_fmi2(tmp_path):
    pytest.importorskip("pythonfmu3")
    three(tmp_path)
    python_fmu(tmp_path, "Takes", "self.y = self.u + 10 * self.on")
    text = 'coupling = "jacobi"\n' + fmu_table("three", "Three", "start.u = [1.0, 2.0, 3.0]\n")
    text += fmu_table("takes", "Takes") + wire_table("three.n", "takes.u")
    text += wire_table("three.on", "takes.on") + wire_table("takes.steps", "three.u[2]")
    h, k = ran(tmp_path, text).haptics, np.arange(33)
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


def test_a_vector_goes_by_its_indices_not_by_the_order_of_the_file(tmp_path):
    inputs = {"u[1]": 0.0, "u[10]": 0.0, "u[2]": 0.0}
    body = "values['y'] = values['u[2]'] - values['u[10]']"
    path = slave(tmp_path, "Listed", ("input", inputs), ("output", {"y": 0.0}), body=body)
    assert [s.name for s in describe(path).port("u", "input")] == ["u[1]", "u[2]", "u[10]"]
    found = ran(tmp_path, fmu_table("listed", "Listed", "start.u = [1.0, 2.0, 10.0]\n"))
    assert found.haptics["listed.y"][-1] == -8.0


DECAY_FMU = fmu_table("decay", "Decay")
MODES = """<TypeDefinitions><SimpleType name="Mode"><Enumeration>
<Item name="slow" value="1"/><Item name="fast" value="3"/>
</Enumeration></SimpleType></TypeDefinitions>
<ModelVariables>"""


def decay(folder: Path) -> None:
    """x (an output with a start of its own) halves `mode` times a step; mode is slow or fast."""

    def enumerated(text):
        head, tail = text.replace("<ModelVariables>", MODES).split('name="mode"', 1)
        tail = tail.replace("<Integer", '<Enumeration declaredType="Mode"', 1)
        return f'{head}name="mode"{tail}'

    exact = 'Fmi2Initial.exact if name == "x" else None'
    variables = ("output", {"x": 1.0}), ("parameter", {"mode": 1})
    body = "values['x'] *= 0.5 ** values['mode']"
    edited(slave(folder, "Decay", *variables, body=body, initial=exact), enumerated)


def test_states_take_their_start_and_enumerations_the_names_of_their_items(tmp_path):
    decay(tmp_path)
    for start, first, share in (('mode = "fast", x = 4', 4.0, 0.125), ("mode = 1", 1.0, 0.5)):
        x = ran(tmp_path, f"{DECAY_FMU}start = {{ {start} }}\n").haptics["decay.x"]
        np.testing.assert_array_equal(x, first * share ** np.arange(len(x)))


@pytest.mark.parametrize(
    ("start", "message"),
    [('mode = "fats"', "mode is one of slow, fast"), ("mode = 1.5", "mode takes a whole number")],
)
def test_items_that_an_enumeration_does_not_have(tmp_path, start, message):
    decay(tmp_path)
    found = findings(tmp_path, f"{DECAY_FMU}start = {{ {start} }}\n")
    assert message in found["fmu[0] (decay).start.mode"][1]


def test_an_fmu_acts_on_our_mechanism(tmp_path):
    """x = t^2/2 F/m."""
    python_fmu(tmp_path, "Push", "self.y = 3.0")
    text = fmu_table("push", "Push", 'start.gain = 1\ntiming = "sampled"\n')
    text += wire_table("push.y", "virtual_mechanism.F_hand[1]") + BAR[BAR.index("[linkage]") :]
    found = ran(tmp_path, text, "linkage.body.bar.mass=2", "linkage.start_velocity.slide=0").haptics
    x = found["virtual_mechanism.x"][:, 0]
    np.testing.assert_allclose(x, 0.75 * found["time"] ** 2, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("source", "target", "value", "how", "expected"),
    [
        ("mm", "m", 1500.0, "", 1.5),
        ("degC", "K", 20.0, "", 293.15),
        ("K", "degC", 273.15, "", 0.0),
        ("deg", "rad", 180.0, "", math.pi),
        ("m", "m", 2.0, "", 2.0),
        ("mm", "m", 1500.0, "factor = -2.0\noffset = 10.0\n", 7.0),  # after the units
        ("mm", "m", 1500.0, "convert = false\n", 1500.0),
    ],
)
def test_units_convert(tmp_path, source, target, value, how, expected):
    with_units(python_fmu(tmp_path, "Gives", f"self.y = {value}"), y=source)
    with_units(python_fmu(tmp_path, "Takes", "self.y = self.u"), u=target)
    found = ran(tmp_path, PAIR + how).haptics["takes.y"][-1]
    assert found == pytest.approx(expected, rel=1e-15, abs=1e-12)


def test_a_difference_of_temperatures_has_no_offset():
    base = (0, 0, 0, 0, 1, 0, 0, 0)
    degree, kelvin = Unit("degC", base, 1.0, 273.15), Unit("K", base)
    assert conversion(degree, kelvin) == Linear(1.0, 273.15)
    assert conversion(degree, kelvin, relative=True) == SAME
    assert Linear(2.0, 1.0).after(Linear(3.0, 5.0)) == Linear(6.0, 11.0)


def findings(folder: Path, text: str) -> dict[str, tuple[int | None, str]]:
    """(line, message) by key, of a scene that reading or building refuses."""
    with pytest.raises(SceneFault) as refused:
        simulate(str(scene(folder, text)), folder / "out")
    return {f.key: (f.line, f.message) for f in refused.value.findings}


AGAIN = wire_table("takes.y", "takes.u")


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
        ("#end", AGAIN, "connection[1].to", 16, "takes.u is fed by gives.y already"),
    ],
)  # fmt: skip
def test_faults_of_tables_have_their_place(tmp_path, old, new, key, line, message):
    python_fmu(tmp_path, "Gives")
    python_fmu(tmp_path, "Takes")
    found = findings(tmp_path, (PAIR + "#end").replace(old, new, 1))
    assert key in found, found
    assert found[key][0] == line
    assert message in found[key][1]


@pytest.mark.parametrize(
    ("unit", "why"),
    [("rad", "y is in mm, u in rad: m is not rad"), ("furlong", "furlong has no BaseUnit")],
)
def test_units_that_do_not_convert_are_refused_with_both(tmp_path, unit, why):
    with_units(python_fmu(tmp_path, "Gives"), y="mm")
    with_units(python_fmu(tmp_path, "Takes"), u=unit)
    line, message = findings(tmp_path, PAIR)["connection[0]"]
    assert line == 11
    assert why in message


def test_paths_are_relative_to_the_scene_file_and_options_reach_in(tmp_path):
    (tmp_path / "below").mkdir()
    python_fmu(tmp_path, "Gives")
    path = scene(tmp_path / "below", fmu_table("gives", "../Gives"))
    read = open_scene.load(str(path), ["fmu.gives.rate=30"])
    assert Path(read.fmu[0].path).samefile(tmp_path / "Gives.fmu")
    assert read.fmu[0].rate == 30


TURNING = (
    fmu_table("slow", "Slow", "rate = 16\n")
    + fmu_table("fast", "Fast")
    + wire_table("slow.y", "fast.u")
    + '[holds]\n"slow.y" = "foh"\n[kinds]\n"slow.y" = "angle"\n'
)


def test_an_angle_in_degrees_is_continued_over_its_seam(tmp_path):
    """A turn of 400 degrees a second, wrapped: first order gives the line back."""
    body = "self.y = (400 * (time + size) + 180) % 360 - 180"
    with_units(python_fmu(tmp_path, "Slow", body), y="deg")
    with_units(python_fmu(tmp_path, "Fast", "self.y = self.u"), u="deg", y="deg")
    found = ran(tmp_path, TURNING, "duration=2.0").haptics
    time, seen = found["time"][12:], found["fast.y"][12:]
    # The value for the middle of the step that ends here.
    np.testing.assert_allclose(seen, 400 * (time - 0.5 / 64), rtol=0, atol=1e-8)


def test_what_is_no_angle_is_not_unwrapped(tmp_path):
    with_units(python_fmu(tmp_path, "Slow"), y="m")
    python_fmu(tmp_path, "Fast")
    with pytest.raises(SceneFault, match="in m, which is no angle"):
        run(tmp_path, TURNING)


# --- connections to parameters: tunable ones act at each communication point, fixed ones once ---

GAIN = PAIR.replace("takes.u", "takes.gain")


@pytest.fixture
def gives_and_takes(tmp_path):
    python_fmu(tmp_path, "Gives", "self.y = 100.0 + 400.0 * (time + size)")
    python_fmu(tmp_path, "Takes", "self.y = self.gain")
    return tmp_path


def test_a_tunable_parameter_is_set_at_each_communication_point(gives_and_takes):
    results = simulate(str(scene(gives_and_takes, GAIN)), gives_and_takes / "out").results
    given = results.haptics["gives.y"]
    np.testing.assert_array_equal(results.haptics["takes.y"][1:], given[:-1])
    assert given[-1] == 100.0 + 400.0 * 0.5
    assert results.run["delays"]["gives.y -> takes.gain"]["max"] == 0.0


def test_a_fixed_parameter_is_set_once(gives_and_takes):
    edited(gives_and_takes / "Takes.fmu", lambda text: text.replace('"tunable"', '"fixed"'))
    results = simulate(str(scene(gives_and_takes, GAIN)), gives_and_takes / "out").results
    np.testing.assert_array_equal(results.haptics["takes.y"], 0.0)


MASS = """
linkage.operational_point.body = "mass"
linkage.body = [{ name = "mass", mass = 2.0, inertia = 1.0 }]
linkage.joint = [
    { name = "slide", type = "prismatic", child = "mass", axis = 0.0, stiffness = 1.0 },
]
linkage.start = { slide = 0.3 }
connection = [{ from = "gives.y", to = "virtual_mechanism.slide.stiffness" }]
fmu = [{ name = "gives", path = "Gives.fmu", rate = "haptics" }]
"""


@pytest.mark.parametrize("packaging", ["python", "native"])
def test_a_spring_that_stiffens_in_steps(gives_and_takes, packaging):
    """m x'' = -k(t_k) x over each step, in closed form."""
    path = scene(gives_and_takes, f'packaging = "{packaging}"' + MASS, rate=512)
    table = simulate(str(path), gives_and_takes / "out").results.haptics
    state, found = np.array([0.3, 0.0]), []
    for k in table["gives.y"]:
        found.append(state[0])
        state = expm(np.array([[0.0, 1.0], [-k / 2.0, 0.0]]) / 512) @ state
    np.testing.assert_allclose(table["virtual_mechanism.q[1]"], found, atol=1e-8)


# --- whole numbers that the library of a Python FMU would cut -----------------------------------

COUNTER = """
from pythonfmu3 import *

class Counts(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.n, self.time = 0, 0.0
        discrete, output = Fmi3Variability.discrete, Fmi3Causality.output
        self.register_variable(KIND("n", causality=output, variability=discrete))
        independent, continuous = Fmi3Causality.independent, Fmi3Variability.continuous
        self.register_variable(Float64("time", causality=independent, variability=continuous))

    def do_step(self, time, size):
        self.n = BODY
        return Fmi3StepResult(status=Fmi3Status.ok)
"""


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize(
    ("kind", "value", "limits"),
    [
        ("Integer", 3 * 10**9, "-2147483648 to 2147483647"),
        ("Int32", -(2**31) - 1, "-2147483648 to 2147483647"),
        ("UInt64", -2048, f"0 to {2**64 - 1}"),
    ],
)
def test_a_whole_number_that_its_library_would_cut_ends_the_run(
    tmp_path, kind, value, limits, isolate
):
    body = f"{value} if time > 0.2 else 7"
    if kind == "Integer":
        slave(tmp_path, "Counts", ("output", {"n": 7}), body=f"self.n = {body}")
    else:
        pytest.importorskip("pythonfmu3")
        text = COUNTER.replace("KIND", kind).replace("BODY", body)
        python_fmu_of(tmp_path, text, f"counts{kind}{bool(isolate)}", "3")
    experiment, found = run(tmp_path, fmu_table("one", "Counts", isolate))
    assert f"n is {value}: its type holds {limits}, and the" in str(experiment.outcome.fault)
    assert found.haptics["one.n"][-1] == 7
