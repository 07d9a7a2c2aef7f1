"""Step control where an FMU fails in steps that are too long, and what errors count."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.run.event_loop import Outcome
from hapticlink.orchestrator.scene.records import Iteration, StepControl
from hapticlink.orchestrator.system.system import System
from tests.orchestrator.coupled import ROWS, error, simulate, system
from tests.orchestrator.native_mass import native

FINE = 0.0005
"""Longer steps fail where mass one is beyond 0.2 m (s)."""


def controlled(
    folder: Path, one: Description, least: str = "1/50000", tolerance: float = 0.1, **others: object
) -> System:
    how: dict[str, object] = {"coupling": "jacobi", "hold": "foh", **others}
    return system(
        {"one": one, "two": native(folder, "two")},
        ROWS,
        str(how.pop("coupling")),
        Fraction(2, 100),
        Fraction("0.3"),
        base=Fraction(1, 50000),
        get_after_set=("one", "two"),
        step_control=StepControl(method="doubling", tolerance=tolerance, min=least),
        **how,  # type: ignore[arg-type]
    )


def brittle(folder: Path, failure: int) -> Description:
    return native(folder, "one", brittle=0.2, fine=FINE, failure=failure)


NAN, DISCARD, ERROR, FATAL = 0, 2, 3, 4


@pytest.mark.parametrize(
    ("failure", "isolate"),
    [(NAN, False), (DISCARD, False), (ERROR, False), (NAN, True), (ERROR, True)],
)
def test_a_step_that_fails_is_taken_back_and_shortened(
    tmp_path: Path, failure: int, isolate: bool
) -> None:
    made = controlled(tmp_path, brittle(tmp_path, failure))
    made = replace(made, fmus=tuple(replace(u, isolate=isolate) for u in made.fmus))
    outcome, table = simulate(made, tmp_path)
    assert outcome.fault is None
    steps = outcome.details.controlled_steps["haptics"]
    assert steps.failed > 0
    assert steps.longest > 2 * FINE
    whole, _ = simulate(controlled(tmp_path, native(tmp_path, "one")), tmp_path)
    assert whole.steps["haptics"].failed == 0
    assert error(table) < 0.02


def test_iterated_steps_that_do_not_converge_for_it_are_shortened_too(tmp_path: Path) -> None:
    made = controlled(
        tmp_path, brittle(tmp_path, NAN), coupling="iterated", hold=None, between="foh",
        iteration=Iteration(method="newton"), tolerance=0.01,
    )  # fmt: skip
    outcome, table = simulate(made, tmp_path)
    assert outcome.fault is None
    assert outcome.details.controlled_steps["haptics"].failed > 0
    assert error(table) < 0.002


@pytest.mark.parametrize(
    ("failure", "message"),
    [(NAN, "output x is nan"), (DISCARD, "returned discard"), (ERROR, "returned error")],
)
def test_at_the_shortest_step_it_is_a_fault(tmp_path: Path, failure: int, message: str) -> None:
    outcome, table = simulate(controlled(tmp_path, brittle(tmp_path, failure), "1/500"), tmp_path)
    assert message in str(outcome.fault)
    assert outcome.details.controlled_steps["haptics"].failed > 0
    assert 0 < outcome.end_time == table["time"][-1] < 0.3


def test_a_fatal_error_is_a_fault_at_once(tmp_path: Path) -> None:
    outcome, _ = simulate(controlled(tmp_path, brittle(tmp_path, FATAL)), tmp_path)
    assert "fmi2DoStep returned fatal" in str(outcome.fault)
    assert outcome.details.controlled_steps["haptics"].failed == 0


def test_errors_are_measured_against_nominal_values(tmp_path: Path) -> None:
    """Where the nominal is far above the values, twice of it is as good as half the tolerance."""

    def solved(size: float, tolerance: float) -> Outcome:
        nominal = {"x": size, "v": size}
        one = native(tmp_path, "one", nominal=nominal)
        made = controlled(tmp_path, one, tolerance=tolerance)
        two = native(tmp_path, "two", nominal=nominal)
        units = (made.fmus[0], replace(made.fmus[1], description=two))
        return simulate(replace(made, fmus=units), tmp_path)[0]

    large, larger = solved(1e6, 2e-7), solved(2e6, 1e-7)
    coarse, usual = solved(100.0, 0.02), solved(1.0, 0.02)
    assert large.fault is None
    assert large.steps == larger.steps
    assert large.steps["haptics"].rejected > 0
    assert coarse.steps["haptics"].taken < usual.steps["haptics"].taken / 2
