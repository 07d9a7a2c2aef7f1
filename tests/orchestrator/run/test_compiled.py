"""The compiled loop writes the bytes of the one in Python: every scene, hold, scheme and fault."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.event_kinds import event
from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_record import Timings
from hapticlink.orchestrator.run.compiled.library import CHOICE, Unavailable, load
from hapticlink.orchestrator.run.compiled.loop import Events
from hapticlink.orchestrator.scene.scene_tables import Iteration
from tests.little_fmus import python_fmu
from tests.orchestrator import coupled
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.native_mass import held
from tests.orchestrator.results.records import tables_of

try:
    load()
except Unavailable as why:
    pytest.skip(str(why), allow_module_level=True)

SHIPPED = {p.stem: p.read_text() for p in (Path(__file__).parents[3] / "scenes").glob("*.toml")}
SCENES = sorted(n for n, t in SHIPPED.items() if "[hand]" in t or "extends" in t or n == "pendulum")
"""Of those of a mechanism alone, whose plans are one, one."""
NO_MATRICES = [f"holds.virtual_mechanism.{port}=zoh" for port in ("P_c", "Lambda_inv")]
"""Extrapolated matrices agree to rounding, other values to the last bit."""
OWN = ("timings", "in_python")
"""What run.json says of how a run was carried out."""


def both(
    scene: str, folder: Path, monkeypatch: pytest.MonkeyPatch, *options: str
) -> tuple[dict[str, Any], dict[str, str]]:
    """The run.json that both loops give, and what the compiled loop left to Python."""
    told = []
    for choice in ("python", "compiled"):
        monkeypatch.setenv(CHOICE, choice)
        simulate(scene, folder / choice, options)
        run = json.loads((folder / choice / "run.json").read_text())
        told.append({key: value for key, value in run.items() if key not in OWN})
    assert told[0] == told[1]
    assert tables_of(folder / "python") == tables_of(folder / "compiled")
    return told[1], run["in_python"]


@pytest.mark.parametrize("name", SCENES)
def test_every_shipped_scene(tmp_path, monkeypatch, name):
    run, left = both(name, tmp_path, monkeypatch, "duration=0.1")
    assert run["fault"] is None
    assert not left


@pytest.mark.parametrize("hold", [*HOLDS.names()])
def test_every_hold(tmp_path, monkeypatch, hold):
    """Of samples that are late and lost, and beside them of some that are in time."""
    kind = "downsampling" if HOLDS[hold].downsamples else "hold"
    options = [f"{kind}={hold}", *NO_MATRICES, "graphics.rate=60", "duration=0.3"]
    late = "delays.virtual_mechanism.x={ min = 0.001, max = 0.03, loss = 0.1, seed = 3 }"
    run, _ = both("closed-loop-direct", tmp_path, monkeypatch, *options, late)
    assert hold in run["holds"].values()
    assert sum(link["lost"] for link in run["links"].values())


def test_matrices_that_are_extrapolated(tmp_path, monkeypatch):
    tables = []
    for choice in ("python", "compiled"):
        monkeypatch.setenv(CHOICE, choice)
        options = ["hold=foh", "graphics.rate=60", "duration=0.3"]
        ended = simulate("closed-loop-direct", tmp_path / choice, options)
        assert {*ended.run["held_as"].values()} == {"semidefinite", "projector"}
        tables.append(ended.results.haptics.rows)
    assert np.abs(tables[0] - tables[1]).max() <= 1e-9 * np.abs(tables[0]).max()


@pytest.mark.parametrize("hold", ["passive", "nepce"])
def test_a_tank_that_both_sides_share(tmp_path, monkeypatch, hold):
    options = [f"hold={hold}", "graphics.rate=30", "duration=0.5"]
    options += [f"holds.controller.{end}=pspm" for end in ("x_S", "v_S")]
    for late in ([], ["delays.controller.x_S={ min = 0.001, max = 0.05, loss = 0.2, seed = 3 }"]):
        _, left = both("closed-loop-direct", tmp_path, monkeypatch, *options, *late)
        assert not left


@pytest.mark.parametrize(
    "options",
    [
        ["coupling=jacobi"],
        ["hold=foh", *(f"holds.virtual_environment.{p}=zoh" for p in ("P_c", "Lambda_inv"))],
        ["coupling=gauss-seidel-plants"],
        ["graphics.rate={ min = 20, max = 60, seed = 2 }"],
        ["graphics.align=tick", "graphics.rate=29.97", "graphics.phase=0.01"],
        ["controller.bias=full"],
        ["stop_when='virtual_mechanism.energy > 1e-5'"],
    ],
    ids=lambda options: options[0],
)
def test_every_scheme_and_rate(tmp_path, monkeypatch, options):
    both("closed-loop", tmp_path, monkeypatch, "duration=0.2", *options)


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
def test_substeps_and_isolated_fmus(tmp_path, monkeypatch, coupling, isolate):
    """Of FMUs in processes of their own, too, which change no byte."""
    python_fmu(tmp_path, "Gives", "self.y = 0.9 * self.y + 0.1 * time + 0.3 * self.u")
    path = str(scene(tmp_path, STEPS.format(coupling=coupling)))
    run, left = both(path, tmp_path, monkeypatch, *([f"{isolate}=true"] if isolate else []))
    apart = {"": [], "isolate": ["one", "two"], "fmu.two.isolate": ["two"]}[isolate]
    assert sorted(run["isolated"]) == apart
    assert {each for each in left if each.startswith("step")} == {f"step {name}" for name in apart}
    assert bool(left) == bool(apart)
    simulate(path, tmp_path / "here")
    assert len(tables_of(tmp_path / "here")) == 2
    assert tables_of(tmp_path / "here") == tables_of(tmp_path / "compiled")


FAULTS = {
    "raises": "if time > 0.2: raise RuntimeError('broken gear')",
    "NaN": "self.y = float('nan') if self.steps == 5 else float(self.steps)",
    "discards": "return time < 0.2",
    "takes only short steps": "if size > 0.005: return False\n        self.y += size",
}


@pytest.mark.parametrize("policy", ["", "faults.nan=hold", "faults.discard=retry"])
@pytest.mark.parametrize("body", FAULTS.values(), ids=FAULTS)
def test_faults_of_python_fmus(tmp_path, monkeypatch, body, policy):
    python_fmu(tmp_path, "Fails", body, canGetAndSetFMUstate=True)
    options = [policy] if policy else []
    both(str(scene(tmp_path, fmu_table("one", "Fails"))), tmp_path, monkeypatch, *options)


LEFT = {
    "OverflowError": "if self.steps == 5: self.steps = 10**30",
    "ValueError": "if self.steps == 5: return __import__('numpy').zeros(2)",
}


@pytest.mark.parametrize("error", LEFT)
def test_exceptions_that_a_python_fmu_leaves_behind(tmp_path, monkeypatch, error):
    """The library of pythonfmu checks neither an integer's size nor a status that has no truth
    value: it goes on with -1, or with a step that is taken."""
    python_fmu(tmp_path, "Leaves", LEFT[error])
    run, _ = both(str(scene(tmp_path, fmu_table("one", "Leaves"))), tmp_path, monkeypatch)
    assert error in run["fault"]["message"]


REPEATED: dict[str, dict[str, Any]] = {
    "Newton": {"between": "hermite"},
    "Aitken, substeps": {"between": "foh", "substeps": 2, "iteration": Iteration()},
}


@pytest.mark.parametrize("settings", REPEATED.values(), ids=REPEATED)
def test_steps_that_are_taken_back(tmp_path, monkeypatch, settings):
    """The two-mass oscillator, iterated."""
    fmus = held(tmp_path)
    found = []
    for choice in ("python", "compiled"):
        monkeypatch.setenv(CHOICE, choice)
        made = coupled.iterated(
            fmus, Fraction(1, 2), rate=50, rows=coupled.HERMITE, power=coupled.POWER, **settings
        )
        outcome, table = coupled.simulate(made)
        assert outcome.fault is None
        details = replace(outcome.details, timings=Timings(), in_python={})
        found.append((details, outcome.end_time, table.rows.tobytes()))
    assert found[0] == found[1]
    assert found[0][0].energies_within_a_rate


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
