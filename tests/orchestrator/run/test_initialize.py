"""Start values: in the order of what depends on what, loops by Newton's method, read again behind
the end of initialisation mode. The stop time and the tolerance that FMUs are told."""

import math
import re
import uuid
from pathlib import Path

import pytest

from tests.little_fmus import edited, python_fmu_of
from tests.orchestrator.c_fmus import told_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fault, fmu_table, ran, wire_table

FUNCTION = """
from math import atan, log
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.late, self.x = {start}, 0.0, 0.0
        causality = Fmi2Causality.output
        self.register_variable(Real("u", causality=Fmi2Causality.input, start=self.u))
        self.register_variable(Real("y", causality=causality, getter=self.y))
        self.register_variable(
            Integer("n", causality=causality, variability=Fmi2Variability.discrete,
                    getter=lambda: round(self.y()) if self.y() == self.y() else 0))
        self.register_variable(Real("one", causality=causality, getter=lambda: 1.0))
        self.register_variable(Real("late", causality=causality))
        self.register_variable(Real("x", causality=causality))

    def y(self):
        u = self.u
        if abs(u) > {most}:
            raise ValueError(f"u = {{u}} is outside of the table")
        return {y}

    def exit_initialization_mode(self):
        self.late = 5.0

    def do_step(self, time, size):
        self.x += self.u * size
        return True
"""


def function(folder: Path, name: str, y: str, start: float = 0.0, most: float = math.inf) -> Path:
    """An FMU with y = f(u), its rounded n, one = 1, and late, which it sets to 5 in ending its
    initialisation; x is the integral of u. It refuses |u| > most, and declares no dependencies."""
    largest = "float('inf')" if math.isinf(most) else most
    text = FUNCTION.format(name=name, y=y, start=start, most=largest)
    return python_fmu_of(folder, text, uuid.uuid4().hex)


LOGARITHM = "u - log(u - 1) if u > 1 else float('nan')"


def loop(folder: Path, a: str, b: str, of_b: str = "y", **b_about: float) -> str:
    """A scene of y_a = a(y_b) and y_b = b(y_a)."""
    function(folder, "A", a)
    function(folder, "B", b, **b_about)
    wires = wire_table("a.y", "b.u") + wire_table(f"b.{of_b}", "a.u")
    return fmu_table("a", "A") + fmu_table("b", "B") + wires


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_what_is_set_in_ending_initialisation_is_in_the_first_row_and_step(tmp_path, isolate):
    function(tmp_path, "A", "u")
    scene = fmu_table("a", "A", isolate) + fmu_table("b", "A", isolate)
    found = ran(tmp_path, scene + wire_table("a.late", "b.u")).haptics
    assert found["a.late"].tolist() == [5.0] * len(found["time"])
    assert found["b.x"] == pytest.approx(5.0 * found["time"])


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_an_output_is_read_after_what_it_depends_on(tmp_path, isolate):
    """1/u has no value for u's start, 0; declared first, it is read first no more."""
    function(tmp_path, "Inverse", "1 / u")
    function(tmp_path, "Two", "2.0")
    scene = fmu_table("inverse", "Inverse", isolate) + fmu_table("two", "Two", isolate)
    found = ran(tmp_path, scene + wire_table("two.y", "inverse.u")).haptics
    assert found["inverse.y"][0] == 0.5


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_outputs_of_one_fmu_have_their_own_order(tmp_path, isolate):
    """inverse.y = 1/u follows twice.y, which follows inverse.one, which follows nothing."""

    def declare(text: str) -> str:
        on = {2: "1", 3: "1", 4: "", 5: "", 6: ""}  # by index of an output: that of u, or none
        unknowns = (f'<Unknown index="{i}" dependencies="{of}"/>' for i, of in on.items())
        declared = f"<InitialUnknowns>{''.join(unknowns)}</InitialUnknowns>"
        return text.replace("</Outputs>", f"</Outputs>{declared}")

    edited(function(tmp_path, "Inverse", "1 / u"), declare)
    function(tmp_path, "Twice", "2 * u")
    scene = fmu_table("inverse", "Inverse", isolate) + fmu_table("twice", "Twice", isolate)
    wires = wire_table("inverse.one", "twice.u") + wire_table("twice.y", "inverse.u")
    assert ran(tmp_path, scene + wires).haptics["inverse.y"][0] == 0.5


def test_dependencies_that_are_declared_wrongly(tmp_path):
    """y = 2 u is declared to follow nothing, so that it is read too early at first."""
    nothing = '</Outputs><InitialUnknowns><Unknown index="2" dependencies=""/></InitialUnknowns>'
    edited(function(tmp_path, "Lies", "2 * u"), lambda text: text.replace("</Outputs>", nothing))
    function(tmp_path, "One", "1.0 + 0 * u")
    scene = "".join(fmu_table(name, "Lies") for name in "abc") + fmu_table("one", "One")
    wires = (("one.y", "c.u"), ("c.y", "b.u"), ("b.y", "a.u"))
    found = ran(tmp_path, scene + "".join(wire_table(*w) for w in wires)).haptics
    assert [found[f"{name}.y"][0] for name in "abc"] == [8.0, 4.0, 2.0]


@pytest.mark.parametrize(
    ("a", "b", "y_b", "about"),
    [
        ("2 * u + 1", "4 - 3 * u", 1 / 7, {"most": 3.0}),  # passed around, it grows sixfold
        ("u", "u - atan(u - 3)", 3.0, {}),  # Newton's whole steps go ever further away
        ("u", LOGARITHM, 2.0, {"start": 9.0}),  # and here to where there is no logarithm
        ("u * u", "2.0", 2.0, {"most": 5.0}),  # none but by declaration
    ],
)
def test_a_loop_is_solved_from_its_start_values(tmp_path, a, b, y_b, about):
    scene = loop(tmp_path, a, b, **about)
    found = ran(tmp_path, scene).haptics
    assert found["b.y"][0] == pytest.approx(y_b, rel=1e-11)


def test_whole_numbers_are_passed_around_a_loop(tmp_path):
    """n = round(1.2 - 0.4 y_a), y_a = n / 2: 1 for n = 1."""
    found = ran(tmp_path, loop(tmp_path, "u / 2", "1.2 - 0.4 * u", "n")).haptics
    assert (found["a.y"][0], found["b.n"][0]) == (0.5, 1.0)


@pytest.mark.parametrize(("a", "n"), [("(u // 2) + 5", 9.0), ("min(u + 1, 30)", 30.0)])
def test_whole_numbers_go_around_as_long_as_changes_do_not_grow(tmp_path, a, n):
    found = ran(tmp_path, loop(tmp_path, a, "u", "n")).haptics
    assert found["b.n"][0] == n


def test_whole_numbers_without_a_solution_are_told(tmp_path):
    """n = round(4 - 3 (2 n + 1)) = 1 - 6 n for no whole n."""
    told = fault(tmp_path, loop(tmp_path, "2 * u + 1", "4 - 3 * u", "n", most=1000.0))
    assert "b: output n does not converge in initialisation: " in told
    assert "around its algebraic loop (" in told


# --- the experiment -----------------------------------------------------------------------

TOLD = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Told(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.stop = self.tolerance = self.ramp = -1.0
        for name in ("stop", "tolerance", "ramp"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def setup_experiment(self, start_time, stop_time, tolerance):
        self.stop = -1.0 if stop_time is None else stop_time
        self.tolerance = -1.0 if tolerance is None else tolerance

    def do_step(self, time, size):
        self.ramp = (time + size) / self.stop
        return True
"""


def told(folder: Path, fmi: str) -> Path:
    """Told.fmu puts out the stop time and the tolerance that it is told, -1 for none, and the share
    of the stop time that its steps have reached."""
    return told_fmu3(folder) if fmi == "3" else python_fmu_of(folder, TOLD, uuid.uuid4().hex)


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_the_stop_time_is_that_of_the_run(tmp_path, fmi, isolate):
    """Rates of 64 and 24 Hz, 0.5 s; a sampled block begins its last step at the end of the run."""
    told(tmp_path, fmi)
    of = {"plant": "", "sampled": 'timing = "sampled"\n', "slow": "rate = 24\n"}
    of["slow_sampled"] = of["sampled"] + of["slow"]
    scene = "".join(fmu_table(name, "Told", isolate + lines) for name, lines in of.items())
    found = ran(tmp_path, scene)
    haptics, slow = found.haptics, found.tables["24hz"]
    assert haptics["plant.stop"][0] == slow["slow.stop"][0] == 0.5
    assert haptics["sampled.stop"][0] == 0.5 + 1 / 64
    assert slow["slow_sampled.stop"][0] == pytest.approx(0.5 + 1 / 24)
    ramps = haptics["plant.ramp"], slow["slow.ramp"], haptics["sampled.ramp"]
    assert [ramp[-1] for ramp in ramps] == pytest.approx([1.0, 1.0, 1.0])


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize(
    ("declared", "line", "tolerance"),
    [
        ("", "", -1.0),
        ("1e-3", "", 1e-3),
        ("1e-3", "tolerance = 1e-5\n", 1e-5),
        ("", "tolerance = 1e-5\n", 1e-5),
        ("0", "", -1.0),
    ],
)
def test_the_tolerance_is_that_of_the_default_experiment_or_the_scene(
    tmp_path, fmi, declared, line, tolerance
):
    def declare(text: str) -> str:
        head, rest = re.sub("<DefaultExperiment.*?/>", "", text).split("<ModelVariables>")
        experiment = f'<DefaultExperiment tolerance="{declared}"/>' * bool(declared)
        return f"{head}{experiment}<ModelVariables>{rest}"

    edited(told(tmp_path, fmi), declare)
    found = ran(tmp_path, fmu_table("one", "Told", line)).haptics
    assert found["one.tolerance"][0] == tolerance


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_an_fmu_that_could_go_back_is_told_that_no_run_asks_it_to(tmp_path, isolate):
    """Some do no step where they are told that one may be taken back."""
    told_fmu3(tmp_path, canGetAndSetFMUState="true")
    found = ran(tmp_path, fmu_table("told", "Told", isolate)).haptics
    assert set(found["told.forward"][1:]) == {1.0}
