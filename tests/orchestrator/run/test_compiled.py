"""The loop carries out every scene and hold in C, and leaves to Python what has to be there."""

import shutil
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from hapticlink.commands import doctor
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.event_kinds import event
from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run.compiled import build, library
from hapticlink.orchestrator.run.compiled.loop import Events
from hapticlink.orchestrator.scene.scene_tables import Iteration
from tests.little_fmus import python_fmu
from tests.orchestrator import coupled
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.native_mass import held
from tests.orchestrator.results.records import tables_of

SHIPPED = {p.stem: p.read_text() for p in (Path(__file__).parents[3] / "scenes").glob("*.toml")}
SCENES = sorted(n for n, t in SHIPPED.items() if "[hand]" in t or "extends" in t or n == "pendulum")
"""Of those of a mechanism alone, whose plans are one, one."""


@pytest.mark.parametrize("name", SCENES)
def test_every_shipped_scene_runs_in_c(tmp_path, name):
    run = simulate(name, tmp_path, ["duration=0.06"]).results.run
    assert run["fault"] is None
    assert run["in_python"] == {}


@pytest.mark.parametrize("hold", [*HOLDS.names()])
def test_every_hold(tmp_path, hold):
    """Of samples that are late and lost, and beside them of some that are in time."""
    kind = "downsampling" if HOLDS[hold].downsamples and hold != "model" else "hold"
    if hold == "reaction":  # of a hand
        kind = "holds.'hand.F -> virtual_mechanism.F_hand'"
    options = [f"{kind}={hold}", "graphics.rate=60", "duration=0.3"]
    # Gradients are those of the graphics copy.
    scene, port = ("closed-loop-direct", "virtual_mechanism.x")
    if HOLDS[hold].needs == "gradient":
        scene, port = ("closed-loop-ideal", "virtual_environment.P_c")
    late = f"delays.{port}={{ min = 0.001, max = 0.03, loss = 0.1, seed = 3 }}"
    run = simulate(scene, tmp_path, [*options, late]).results.run
    assert hold in run["holds"].values()
    assert sum(link["lost"] for link in run["links"].values())
    assert run["in_python"] == {}


def test_the_compiler_of_the_machine_comes_before_zig(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: f"/bin/{name}" if name == "gcc" else None)
    assert next(build.compilers()).command == ["/bin/gcc"]


def test_a_machine_without_the_library_is_told_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setattr(build, "name", lambda tag=None: "loop-of-no-machine.so")
    monkeypatch.setattr(build, "compilers", lambda: iter(()))
    library.load.cache_clear()
    try:
        ended = simulate("pendulum", tmp_path, ["duration=0.1"])
        told = doctor._loop()
    finally:
        library.load.cache_clear()
    for said in (str(ended.outcome.fault), told.removeprefix("no: ")):
        assert said.startswith("the event loop, a library of C, is not there for ")
        assert "it is not built, and there is no C compiler; take a wheel" in said
        assert 'pip install "hapticlink[native]"' in said


def test_the_loop_in_python_is_refused(monkeypatch):
    library.load.cache_clear()
    monkeypatch.setenv("HAPTICLINK_LOOP", "python")
    with pytest.raises(Fault, match="no event loop in Python any more: unset it"):
        library.load()


STEPS = (
    'coupling = "{coupling}"\nsubsteps.two = 3\n'
    + fmu_table("one", "Gives")
    + fmu_table("two", "Gives", "rate = 24\n")
    + wire_table("one.y", "two.u", 'factor = 0.3\nhold = "foh"\n')
    + wire_table("two.y", "one.u", 'hold = "smooth"\n')
)


@pytest.mark.parametrize(
    ("coupling", "isolate"),
    [
        ("gauss-seidel", ""),
        ("jacobi", ""),
        ("gauss-seidel", "isolate"),
        ("jacobi", "fmu.two.isolate"),
    ],
)
def test_substeps_and_isolated_fmus(tmp_path, coupling, isolate):
    """FMUs in processes of their own, which Python steps, change no byte."""
    python_fmu(tmp_path, "Gives", "self.y = 0.9 * self.y + 0.1 * time + 0.3 * self.u")
    path = str(scene(tmp_path, STEPS.format(coupling=coupling)))
    options = [f"{isolate}=true"] if isolate else []
    run = simulate(path, tmp_path / "apart", options).results.run
    apart = {"": [], "isolate": ["one", "two"], "fmu.two.isolate": ["two"]}[isolate]
    assert sorted(run["isolated"]) == apart
    stepped = {each for each in run["in_python"] if each.startswith("step")}
    assert stepped == {f"step {name}" for name in apart}
    assert bool(run["in_python"]) == bool(apart)
    simulate(path, tmp_path / "here")
    assert len(tables_of(tmp_path / "here")) == 2
    assert tables_of(tmp_path / "here") == tables_of(tmp_path / "apart")


LEFT = {
    "OverflowError": "if self.steps == 5: self.steps = 10**30",
    "ValueError": "if self.steps == 5: return __import__('numpy').zeros(2)",
}


@pytest.mark.parametrize("error", LEFT)
def test_exceptions_that_a_python_fmu_leaves_behind(tmp_path, error):
    """The library of pythonfmu checks neither an integer's size nor a status that has no truth
    value: it goes on with -1, or with a step that is taken."""
    python_fmu(tmp_path, "Leaves", LEFT[error])
    run = simulate(str(scene(tmp_path, fmu_table("one", "Leaves"))), tmp_path / "out").run
    assert error in run["fault"]["message"]


REPEATED: dict[str, dict[str, Any]] = {
    "Newton": {"between": "hermite"},
    "Aitken, substeps": {"between": "foh", "substeps": 2, "iteration": Iteration()},
}


@pytest.mark.parametrize("settings", REPEATED.values(), ids=REPEATED)
def test_steps_that_are_taken_back_count_once(tmp_path, settings):
    """The two-mass oscillator, iterated: its meters end with the energy of the rows."""
    made = coupled.iterated(
        held(tmp_path),
        Fraction(1, 2),
        rate=50,
        rows=coupled.HERMITE,
        power=coupled.POWER,
        **settings,
    )
    outcome, table = coupled.simulate(made)
    assert outcome.fault is None
    assert len(table.rows) == 26
    (iterations,) = [outcome.details.iterations]
    assert iterations.rollbacks > 0
    assert all(energy.until == 0.5 for energy in outcome.details.energies_within_a_rate.values())


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["graphics.rate=29.97", "graphics.align=tick"],
        ["graphics.rate={ min = 20, max = 60, seed = 4 }"],
        ["graphics.rate=30", "graphics.phase=0.01"],
        ["duration=20"],
    ],
)
def test_kinds_of_events_are_bound_before_the_loop(tmp_path, monkeypatch, options):
    """Those that the plan gives, in their order; within the time of the loop only those beyond the
    communication points that it knows from the start."""
    bound: list[list[Event]] = []
    late: list[Event] = []
    original, new = Events.prepare, Events._new_kind

    def prepare(events, kinds):
        bound.append([*kinds])
        original(events, bound[-1])

    def new_kind(events):
        late.append(event(events._timeline, events._key.tobytes()))
        new(events)

    monkeypatch.setattr(Events, "prepare", prepare)
    monkeypatch.setattr(Events, "_new_kind", new_kind)
    ended = simulate("closed-loop-direct", tmp_path, options)
    assert ended.outcome.fault is None
    prepared, *later = bound
    assert later == [[kind] for kind in late]
    assert [*prepared, *late] == [*dict.fromkeys(m.event for m in Plan(ended.system))]
    assert len(late) <= (1 if ended.outcome.end_time > 8 else 0)
