"""Iterated coupling, start values through feed-through loops, order from declared dependencies.

On real FMUs, against closed forms and the two-mass oscillator's numbers, computed independently.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator import describe_run, experiment
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays, uses
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.execute_plan import run
from hapticlink.orchestrator.run.fixed_point import Unconverged
from hapticlink.orchestrator.scene.scene_tables import Iteration
from hapticlink.orchestrator.system.system import System
from tests.little_fmus import edited
from tests.orchestrator.coupled import (
    HERMITE,
    described,
    error,
    gain,
    iterated,
    rows,
    scene_of,
    simulate,
    stiff_exact,
    system,
)
from tests.orchestrator.coupled import order as observed_order
from tests.orchestrator.native_mass import FLAGS, POWER, ROWS, STIFF, held, native, stiff

Fmus = Mapping[str, Description]
UNTIL = Fraction("1.06")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    return held(tmp_path_factory.mktemp("oscillator"))


def largest(fmus: Fmus, rate: int, between: str, substeps: int) -> float:
    """The largest error of a position within 1 s."""
    made = iterated(fmus, UNTIL, between, rate=rate, rows=HERMITE, substeps=substeps)
    return error(rows(made))


@pytest.mark.parametrize(
    ("between", "substeps", "published"), [("foh", 2, 1.73e-3), ("hermite", 8, 7.8e-7)]
)
def test_error_of_the_two_mass_oscillator(fmus, between, substeps, published):
    found = largest(fmus, 100, between, substeps)
    assert found == pytest.approx(published, rel=0.02)


@pytest.mark.parametrize(
    ("between", "substeps", "order"),
    [("zoh", 1, 1), ("foh", 1, 2), ("second-order", 4, 3), ("hermite", 4, 4)],
)
def test_order_is_that_of_the_interpolation(fmus, between, substeps, order):
    rates = [50, 100, 200]
    errors = [largest(fmus, rate, between, substeps) for rate in rates]
    assert observed_order(rates, errors) == pytest.approx(order, abs=0.1)


def test_both_methods_find_the_same(fmus):
    both = (Iteration(method=method, tolerance=1e-11) for method in ("aitken", "newton"))
    aitken, newton = (rows(iterated(fmus, Fraction(1, 2), "foh", iteration=how)) for how in both)
    np.testing.assert_allclose(aitken.rows, newton.rows, atol=1e-7)


def test_what_was_iterated_is_counted(fmus):
    made = iterated(fmus, Fraction(1, 2), "foh", substeps=3, iteration=Iteration())
    outcome, _ = simulate(made)
    found, calls = outcome.details.iterations, outcome.details.calls["two"]
    assert found is not None
    assert found.steps == 50
    assert found.rollbacks == found.iterations - found.steps > 0
    assert calls["step"] == 3 * found.iterations
    assert (calls["save"], calls["rollback"]) == (50, found.rollbacks)


def test_it_reads_the_future_and_says_so(fmus):
    plan = Plan(system(fmus, ROWS, "iterated", Fraction(1, 100), UNTIL, between="foh"))
    assert all(use.described == use.tick + 1 for use in uses(plan))


def test_energy_is_booked_once_for_a_step_that_is_repeated(fmus):
    """Linear interpolation holds the mean of the source's samples, so it generates no energy: the
    work of both books is the same."""
    outcome, _ = simulate(iterated(fmus, UNTIL, "foh", power=POWER))
    booked = outcome.details.meters["two.F -> one.F"]
    assert abs(booked.held) > 1.0
    assert abs(booked.generated) < 1e-8


def test_newton_converges_where_the_fixed_point_does_not(tmp_path):
    fmus = stiff(tmp_path, *STIFF)

    def coupled(coupling, rate, method="newton"):
        how = {"substeps": 2, "get_after_set": ("two",), "iteration": Iteration(method=method)}
        how["between"] = "foh" if coupling == "iterated" else None
        made = system(fmus, ROWS, coupling, Fraction(1, rate), Fraction(1), **how)
        outcome, table = simulate(made)
        found = np.stack([table["one.x"], table["two.x"]], axis=1)
        return outcome.fault, float(np.abs(found - stiff_exact(table["time"], *STIFF)).max())

    assert coupled("jacobi", 100)[1] > 1e6
    fault = coupled("iterated", 100, "aitken")[0]
    assert isinstance(fault, Unconverged)
    assert "two.F -> one.F does not converge at t = " in str(fault)
    (coarse_fault, coarse), (fine_fault, fine) = (coupled("iterated", rate) for rate in (100, 400))
    assert coarse_fault is fine_fault is None
    assert coarse < 1.0
    assert fine < coarse / 12  # order 2


def test_an_fmu_that_cannot_roll_back_is_named(fmus):
    rigid = {"one": fmus["one"], "two": replace(fmus["two"], flags=frozenset())}
    made = iterated(rigid, UNTIL, "foh")
    with pytest.raises(InputFault, match=r"two cannot save .*canGetAndSetFMUstate"):
        list(delays(Plan(made)))


def test_fmus_in_processes_of_their_own_roll_back_too(fmus):
    made = iterated(fmus, Fraction(1, 10), "foh", substeps=2)
    here = rows(made)
    units = tuple(replace(u, isolate=True) for u in made.fmus)
    np.testing.assert_array_equal(rows(replace(made, fmus=units)).rows, here.rows)


def test_a_hold_that_does_not_interpolate_is_refused(fmus):
    made = iterated(fmus, UNTIL, "foh", hold="delayed")
    assert {c.hold for c in made.connections} == {"foh"}


# --- initialisation -----------------------------------------------------------------------


RING = [("a.y", "b.u"), ("b.y", "a.u")]


def gains(folder: Path, b: float, offset: float, a: float = 2.0, **timing: str) -> Fmus:
    """y = a u + 1 and y = b u + offset."""
    return described([gain("a", a, 1.0, **timing), gain("b", b, offset, **timing)], folder)


@pytest.mark.parametrize(("a", "b"), [(2.0, 0.25), (2.0, 3.0), (-5.0, 4.0), (-1.0, 1.0)])
def test_start_values_go_through_a_feed_through_loop_of_any_gain(tmp_path, a, b):
    """y_a = a y_b + 1, y_b = b y_a - 3."""
    made = system(gains(tmp_path, b, -3.0, a), RING, "jacobi", Fraction(1), Fraction(1))
    found = rows(made)["a.y"][0]
    assert found == pytest.approx((1 - 3 * a) / (1 - a * b), rel=1e-12)


def test_a_loop_without_start_values_is_an_error_that_names_it(tmp_path):
    made = system(gains(tmp_path, 0.5, -3.0), RING, "jacobi", Fraction(1), Fraction(1))
    fault = run(Plan(made), RunResults()).fault
    assert isinstance(fault, FmuFault)
    assert "output y does not converge in initialisation: " in str(fault)
    assert "around its algebraic loop (" in str(fault)


# --- order from dependencies --------------------------------------------------------------


def sampled(folder: Path, wires: Iterable[tuple[str, str]], until: int) -> System:
    fmus = gains(folder, 3.0, 0.0, timing="sampled")
    return system(fmus, wires, "gauss-seidel", Fraction(1), Fraction(until))


def test_an_input_that_no_output_follows_makes_no_order(tmp_path):
    """b takes a's y directly, a takes b's into its state only: a goes first."""
    made = sampled(tmp_path, [("a.y", "b.u"), ("b.y", "a.w")], 4)
    ages = delays(Plan(made))
    assert ages["a.y -> b.u"].max == 0.0
    assert ages["b.y -> a.w"].min == 1.0
    np.testing.assert_array_equal(rows(made)["b.y"], 3.0)


def test_a_ring_of_direct_dependencies_is_named(tmp_path):
    with pytest.raises(InputFault, match=r"ring: (a -> b -> a|b -> a -> b);"):
        list(delays(Plan(sampled(tmp_path, RING, 4))))


def test_a_ring_opens_where_only_unread_outputs_are_direct(tmp_path):
    """b.y follows b.u at once, but only b.z is read: z_{k+1} = y_{k-1}, y_k = 2 z_k + 1."""
    wires = [("a.y", "b.u"), ("a.y", "b.w"), ("b.z", "a.u")]
    table = rows(sampled(tmp_path, wires, 8))
    z = [0.0, 1.0]
    for k in range(2, 9):
        z.append(2 * z[k - 2] + 1)
    assert table["b.z"].tolist() == z
    assert table["a.y"].tolist() == [2 * value + 1 for value in z]


# --- as a scene ---------------------------------------------------------------------------

ITERATED = 'coupling = "iterated"\nget_after_set = ["one", "two"]\n'


def test_a_scene_is_iterated_as_it_says(fmus, tmp_path):
    how = 'iteration = { method = "newton", interpolation = "hermite" }\nsubsteps.one = 2\n'
    found = experiment.simulate(scene_of(fmus, ITERATED + how), tmp_path).results.run
    assert found["fault"] is None
    assert found["causal"] is False
    assert set(found["holds"].values()) == {"hermite"}
    assert found["iterations"]["steps"] == 50
    assert found["iterations"]["rollbacks"] > 0
    assert found["iterations"]["jacobians"] >= 1


def test_hermite_gives_way_where_a_source_has_no_derivative(tmp_path):
    """No connection of this scene takes `hold`, so it is not `hold` that does not fit."""
    bare = held(tmp_path)
    edited(bare["two"].path, lambda text: text.replace('"der(F)"', '"F_rate"'))
    how = 'iteration = { method = "newton", interpolation = "hermite", tolerance = 1e-10 }\n'
    path = scene_of(bare, f"{ITERATED}{how}substeps = {{ one = 4, two = 4 }}\n")
    results = experiment.simulate(path, tmp_path / "out").results
    assert results.run["fault"] is None
    assert results.run["holds"] == {
        "two.F -> one.F": "foh",
        "one.x -> two.x1": "hermite",
        "one.v -> two.v1": "hermite",
    }
    assert error(results.haptics) < 2e-3


@pytest.mark.parametrize("degree", [2, None])
def test_a_run_says_how_a_plant_takes_an_input_that_varies_within_its_step(
    tmp_path, degree, monkeypatch
):
    """As a constant: no FMU is told derivatives of its inputs (`one` would fail), whatever it can
    interpolate; by a hold that is no polynomial, too."""
    varying = HOLDS["second-order"]._replace(degree=degree)
    holds = {name: HOLDS[name] for name in HOLDS} | {"second-order": varying}
    monkeypatch.setattr(describe_run, "HOLDS", holds)
    able = {n: native(tmp_path, n, ("canInterpolateInputs", *FLAGS)) for n in ("one", "two")}
    settings = (
        'coupling = "jacobi"\nsubsteps.two = 2\n'
        'holds = { "two.F" = "second-order", "one.x" = "foh", "one.v" = "zoh" }\n'
    )
    found = experiment.simulate(scene_of(able, settings), tmp_path / "out").results.run
    assert found["fault"] is None
    assert found["within_a_step"] == {
        "two.F -> one.F": "constant, the hold at the middle (half-step lead)",
        "one.x -> two.x1": "constant in each of 2 substeps",
    }
