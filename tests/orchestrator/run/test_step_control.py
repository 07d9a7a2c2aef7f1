"""Steps chosen for accuracy: error against tolerance, cost against fixed steps, and who is cut."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays
from hapticlink.orchestrator.run.event_loop import Outcome
from hapticlink.orchestrator.run.step_control import rounded
from hapticlink.orchestrator.scene.records import StepControl
from hapticlink.orchestrator.system.system import EnergyPorts, System
from tests.orchestrator.coupled import POWER, ROWS, described, error, simulate, system
from tests.orchestrator.native_mass import held
from tests.orchestrator.systems import with_coupling
from tests.shared_fixtures import clock

Fmus = Mapping[str, Description]
BASE = Fraction(1, 50000)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    return held(tmp_path_factory.mktemp("oscillator"))


def controlled(
    fmus: Fmus, control: StepControl | None, period: Fraction = Fraction(2, 100), **others: object
) -> System:
    how: dict[str, object] = {"hold": "foh", "until": Fraction("1.06"), **others}
    return system(
        fmus,
        ROWS,
        str(how.pop("coupling", "jacobi")),
        period,
        base=BASE if control else None,
        get_after_set=("one", "two"),
        power=POWER,
        step_control=control,
        **how,  # type: ignore[arg-type]
    )


def doubling(tolerance: float) -> StepControl:
    return StepControl(method="doubling", tolerance=tolerance, min="1/50000")


def ecco(tolerance: float) -> StepControl:
    return StepControl(method="ecco", tolerance=tolerance, min="1/50000", energy=100.0)


def solved(made: System, folder: Path) -> tuple[Outcome, float]:
    outcome, table = simulate(made, folder)
    assert outcome.fault is None
    return outcome, error(table)


def test_steps_that_are_taken_back_do_no_work(fmus: Fmus, tmp_path: Path) -> None:
    """The spring's work is that of steps of 0.1 ms; each was tried as a whole one first."""
    fixed, _ = solved(controlled(fmus, None, Fraction(1, 10000)), tmp_path)
    tried, _ = solved(controlled(fmus, doubling(0.01)), tmp_path)
    assert len(fixed.energies) > 0
    for name, energy in fixed.energies.items():
        scale = max(abs(e.ideal) for e in fixed.energies.values())
        assert tried.energies[name].ideal == pytest.approx(energy.ideal, abs=0.01 * scale)
        assert tried.energies[name].held == pytest.approx(energy.held, abs=0.01 * scale)


@pytest.mark.parametrize(
    ("control", "tolerances", "power"),
    [(doubling, [0.1, 0.01, 0.001], 1.0), (ecco, [1e-4, 1e-5, 1e-6], 2 / 3)],
)
def test_the_error_follows_the_tolerance(
    fmus: Fmus, tmp_path: Path, control: object, tolerances: list[float], power: float
) -> None:
    """Proportional for an error per second; to the power 2/3 for one per step of order 2."""
    errors = [
        solved(controlled(fmus, control(t)), tmp_path)[1]  # type: ignore[operator]
        for t in tolerances
    ]
    observed = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert observed == pytest.approx(power, abs=0.15)


def test_iterated_coupling_takes_longer_steps_for_the_same_tolerance(
    fmus: Fmus, tmp_path: Path
) -> None:
    explicit, first = solved(controlled(fmus, doubling(0.003)), tmp_path)
    made = controlled(
        fmus, doubling(0.003), coupling="iterated", between="foh", hold=None, substeps=2
    )
    iterated, second = solved(made, tmp_path)
    assert max(first, second) < 0.001
    assert iterated.steps["haptics"].taken < explicit.steps["haptics"].taken


def test_it_takes_fewer_steps_than_a_fixed_step_for_the_same_error(
    fmus: Fmus, tmp_path: Path
) -> None:
    """The oscillation dies away within seconds; all steps that were tried are counted."""
    until = Fraction(12)
    long = controlled(fmus, doubling(0.03), Fraction(6, 100), until=until)
    outcome, varied = solved(long, tmp_path)
    rate = 160
    fixed, uniform = solved(controlled(fmus, None, Fraction(1, rate), until=until), tmp_path)
    assert varied < uniform
    assert outcome.details.calls["one"]["step"] < 0.8 * fixed.calls["one"]["step"]


def test_what_was_done_is_counted(fmus: Fmus, tmp_path: Path) -> None:
    outcome, _ = solved(controlled(fmus, doubling(0.01)), tmp_path)
    steps, calls = outcome.details.controlled_steps["haptics"], outcome.details.calls["one"]
    assert steps.rejected > 0
    assert steps.shortest <= 4 / 50000 < steps.longest <= 0.02
    # Each try is a step and its two halves; the forced ones are of one tick, which has no halves.
    assert calls["step"] == 3 * (steps.taken + steps.rejected) - 2 * steps.forced


def test_a_sampled_block_is_never_cut(tmp_path: Path) -> None:
    """It steps at its own ticks only; plants see its last output, and each other's last step."""
    kinds = {
        "plant": ("continuous", ["f", "o"]),
        "other": ("continuous", ["p"]),
        "law": ("sampled", ["d"]),
    }
    fmus = described([clock(n, t, i) for n, (t, i) in kinds.items()], tmp_path)
    rows = [
        ("plant.stamp", "law.d"),
        ("law.stamp", "plant.f"),
        ("other.stamp", "plant.o"),
        ("plant.stamp", "other.p"),
    ]
    control = StepControl(method="doubling", tolerance=1e-3, min="1/1000", max="1/100")
    made = system(
        fmus, rows, "gauss-seidel", Fraction(1, 8), Fraction(1), base=Fraction(1, 8000),
        step_control=control,
    )  # fmt: skip
    outcome, table = simulate(made, tmp_path)
    assert outcome.fault is None
    assert outcome.details.calls["law"]["step"] == 9
    assert outcome.details.calls["plant"]["step"] > 8 * 12
    np.testing.assert_array_equal(table["law.stamp"], table["time"])
    np.testing.assert_array_equal(table["law.seen_d"], table["time"])
    np.testing.assert_array_equal(table["plant.seen_f"][1:], table["time"][:-1])
    seen = table["time"][1:] - table["plant.seen_o"][1:]
    assert (seen > 0).all()
    assert (seen <= 0.01).all()


def test_the_values_of_a_run_taken_back_leave_no_trace(fmus: Fmus, tmp_path: Path) -> None:
    """Steps of one size, each tried whole and then taken in halves: the run with fixed steps."""
    control = StepControl(method="doubling", tolerance=1e9, min="1/50", max="1/50")
    _, table = simulate(controlled(fmus, control), tmp_path)
    _, fixed = simulate(controlled(fmus, None, Fraction(1, 100)), tmp_path)
    np.testing.assert_allclose(table["one.x"], fixed["one.x"][::2], atol=1e-13)


def test_ecco_needs_power_energy_and_extrapolation(fmus: Fmus) -> None:
    made = controlled(fmus, ecco(1e-4))
    without = StepControl(method="ecco", tolerance=1.0, min=1e-3)
    for changed, remedy in (
        (replace(made, energy=EnergyPorts()), r"\[\[power\]\]"),
        (with_coupling(made, step_control=without), "give energy"),
        (with_coupling(made, scheme="gauss-seidel-plants"), "interpolates"),
    ):
        with pytest.raises(InputFault, match=remedy):
            delays(Plan(changed))


def test_there_must_be_something_to_control(fmus: Fmus) -> None:
    made = controlled(fmus, doubling(0.1))
    with pytest.raises(InputFault, match="there are none"):
        delays(Plan(replace(made, connections=())))


@given(st.floats(0, 1e9))
def test_rounded_is_a_little_less(ticks: float) -> None:
    found = rounded(ticks)
    assert found == 1 or ticks * 8 / 9 < found + 1 <= ticks + 1
