"""Observed order, size of the error and limit of stability of every hold, on real FMUs.

The two-mass oscillator with exact subsystems (computed independently, two ways). Where the plant
must take inputs that vary within a step it takes substeps.
"""

from collections.abc import Mapping
from fractions import Fraction

import numpy as np
import pytest

from hapticlink.orchestrator.fmi.description import Description
from tests.orchestrator import coupled
from tests.orchestrator.native_mass import WARM, held

Fmus = Mapping[str, Description]
Hold = str | Mapping[str, str]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    return held(tmp_path_factory.mktemp("masses"))


OWN = {"two.F": "lead", "one.x": "foh-derivative", "one.v": "foh-derivative"}
"""A force has no derivative to send along."""
PASSIVE, NEPCE = ({**OWN, "two.F": hold} for hold in ("passive", "nepce"))
SLOPE = {**OWN, "one.x": "foh", "one.v": "slope"}


def error(fmus: Fmus, rate: int, hold: Hold, substeps: int, **how: object) -> float:
    """The largest error of a position within 1 s after the start."""
    steps = round((1 + WARM) * rate)
    made = coupled.masses(fmus, Fraction(1, rate), steps, hold, substeps=substeps, **how)
    return coupled.error(coupled.rows(made))


@pytest.mark.parametrize(
    ("hold", "substeps", "order", "coupling", "coarsest"),
    [
        ("zoh", 1, 1, "jacobi", 200),
        ("zoh", 4, 1, "gauss-seidel-plants", 200),
        ("latest", 1, 1, "jacobi", 200),
        ("lead", 1, 2, "jacobi", 200),
        ("foh", 1, 2, "jacobi", 200),
        ("foh", 4, 2, "jacobi", 200),
        ("foh", 4, 2, "gauss-seidel-plants", 200),
        (OWN, 1, 2, "jacobi", 200),
        ("second-order", 16, 3, "jacobi", 200),
        ("delayed", 4, 1, "jacobi", 200),
        ("smooth", 4, 1, "jacobi", 200),
        ("mean", 1, 1, "jacobi", 200),
        # These reach it at higher rates.
        (PASSIVE, 1, 1, "jacobi", 400),
        (NEPCE, 1, 1, "jacobi", 400),
        (SLOPE, 1, 1, "jacobi", 400),
    ],
)
def test_order_of_a_hold(fmus, hold, substeps, order, coupling, coarsest):
    rates = [coarsest, 2 * coarsest, 4 * coarsest]
    errors = [error(fmus, rate, hold, substeps, coupling=coupling) for rate in rates]
    within = 0.1 if coarsest == 200 else 0.15
    assert coupled.order(rates, errors) == pytest.approx(order, abs=within)


def test_a_set_position_that_is_not_paid_for_has_no_order(fmus):
    """The motion that the other mass sends is refused in part, at any rate."""
    hold = {"two.F": "lead", "one.x": "pspm", "one.v": "pspm"}
    coarse, fine = (error(fmus, rate, hold, 1) for rate in (800, 1600))
    assert fine > 0.7 * coarse


@pytest.mark.parametrize(
    ("hold", "substeps", "published"),
    [
        ("zoh", 1, 8.75e-2),
        ("foh", 16, 8.90e-3),
        ("second-order", 32, 1.53e-3),
        ("lead", 1, 7.08e-3),
    ],
)
def test_largest_error_at_a_hundredth(fmus, hold, substeps, published):
    found = error(fmus, 100, hold, substeps)
    assert found == pytest.approx(published, rel=0.02)


def growth(
    fmus: Fmus, step: Fraction, hold: str, substeps: int, steps: int, **how: object
) -> float:
    """Of the envelope between the last quarters of a run; 1 is the limit of stability."""
    made = coupled.masses(fmus, step, steps, hold, substeps=substeps, **how)
    size = np.abs(coupled.motion(coupled.rows(made)) / [1.0, 17.0, 1.0, 17.0]).max(axis=1)
    quarter = steps // 4
    return float(size[-quarter:].max() / size[-2 * quarter : -quarter].max())


@pytest.mark.parametrize(
    ("hold", "substeps", "coupling", "get_after_set", "limit"),
    [
        ("zoh", 1, "jacobi", ("two",), ".0404"),
        ("zoh", 1, "jacobi", (), ".0250"),  # get all, set all, step all, as FMI has it
        ("foh", 8, "jacobi", ("two",), ".0630"),
        ("second-order", 16, "jacobi", ("two",), ".0765"),
        ("lead", 1, "jacobi", ("two",), ".0712"),
        ("delayed", 8, "jacobi", ("two",), ".0198"),
        ("zoh", 1, "gauss-seidel-plants", ("two",), ".0402"),
        ("foh", 8, "gauss-seidel-plants", ("two",), ".0763"),
        ("second-order", 16, "gauss-seidel-plants", ("two",), ".0843"),
        # `one.a` follows the force and is not connected: whatever the order of the file, `one`
        # steps first, with the limit of that order (.0569 the other way round).
        ("foh", 8, "gauss-seidel-plants (reversed)", ("two",), ".0763"),
    ],
)
def test_limit_of_stability_to_one_percent(fmus, hold, substeps, coupling, get_after_set, limit):
    coupling, turned, _ = coupling.partition(" (reversed)")
    pair = dict(reversed(fmus.items())) if turned else fmus
    steps = 2000 if substeps == 1 else 500
    how = {"get_after_set": get_after_set, "coupling": coupling}
    below, above = (
        growth(pair, Fraction(limit) * part, hold, substeps, steps, **how)
        for part in (Fraction(99, 100), Fraction(101, 100))
    )
    assert below < 1 < above
