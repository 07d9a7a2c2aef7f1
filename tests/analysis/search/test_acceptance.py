"""What a run must keep, beside numbers that are worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticlink.analysis.search.acceptance import TRACKED, AcceptanceLimits
from tests.devices import device

LIMITS = AcceptanceLimits(42.0)


def row(
    error_mm: float,
    peak_J: float = 0.0,
    work_J: float = 0.1,
    end: str = "duration",
    theta_rad: float = 0.1,
) -> Any:
    return {
        "end": end,
        "end_time_s": 1.5,
        "message": "" if end in ("duration", "stop_when") else "it failed",
        "tracking_max_mm": error_mm,
        "theta_max_rad": theta_rad,
        "port_peak_J": peak_J,
        "hand_work_J": work_J,
    }


@pytest.mark.parametrize(
    ("numbers", "why"),
    [
        (row(5.0, 0.0249), ""),
        (row(5.0, 0.0251), "the user's port gives 25.1 mJ, and may 25"),
        (row(5.0, 0.9e-3, work_J=0.0), ""),
        (row(43.0), "by 43 mm, and may by 42"),
        (row(math.nan), "and may by 42"),
        (row(5.0, theta_rad=1.1), "turns away from its point by 1.1 rad"),
        (row(5.0, end="diverged"), "ends by diverged: it failed"),
        (row(5.0, end="stop_when"), "ends after 1.5 s"),
        ({"end": "refused", "message": "no such key"}, "no such key"),
        ({"end": "duration", "message": ""}, "no tracking error"),
    ],
)
def test_limits_are_the_end_the_error_and_a_quarter_of_the_work(numbers: Any, why: str) -> None:
    found = LIMITS.why_not(numbers)
    assert why in found if why else not found


def test_the_distance_is_a_fifth_of_what_the_device_reaches_at_every_angle() -> None:
    """The workspace of the report's device is 201 mm high, where 55 mm is no tracking."""
    assert AcceptanceLimits.of(device()).distance_mm == pytest.approx(0.2 * 201.0, rel=0.01)


def test_a_run_that_keeps_the_limits_is_a_measure_and_a_wild_one_is_none() -> None:
    limits, broken = LIMITS.beside(row(5.0))
    assert (limits.distance_mm, broken) == (TRACKED * 5.0, "")
    assert LIMITS.beside(row(40.0))[0].distance_mm == 42.0
    for wild in (row(119.0, 43.0, work_J=10.0), row(5.0, 0.1), row(5.0, end="fault")):
        limits, broken = LIMITS.beside(wild)
        assert limits == LIMITS
        assert broken == LIMITS.why_not(wild)


def test_what_ends_early_in_good_order_lets_others_end_as_early() -> None:
    limits, broken = LIMITS.beside(row(5.0, end="stop_when"))
    assert not broken
    assert not limits.why_not(row(5.0, end="stop_when"))
    assert "ends after 1.4 s" in limits.why_not(row(5.0, end="stop_when") | {"end_time_s": 1.4})
