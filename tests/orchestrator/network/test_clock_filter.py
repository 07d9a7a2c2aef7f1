"""The estimate of another clock: its true offset and drift are within what it tells."""

import numpy as np
import pytest

from hapticlink.orchestrator.network.clock_filter import ClockFilter

MS = 1_000_000


def estimated(offset: float, drift: float, ways: tuple[float, float], seed: int = 1) -> ClockFilter:
    """After 20 s at 30 Hz, with exponential queues of those means (ms) on the two ways."""
    random, clock = np.random.default_rng(seed), ClockFilter()
    for i in range(600):
        sent = round(1e9 * i / 30)
        there, back = (round(MS * (0.2 + random.exponential(mean))) for mean in ways)
        received = round(sent + there + 1e9 * offset + drift * sent)
        clock.add(sent, received, received + 3 * MS, sent + there + 3 * MS + back)
    return clock


@pytest.mark.parametrize("ways", [(1, 1), (5, 0.5), (0.5, 30)])
@pytest.mark.parametrize("drift", [0.0, 40e-6, -1e-4])
def test_offset_and_drift_are_within_their_uncertainty(
    ways: tuple[float, float], drift: float
) -> None:
    estimate = estimated(3600.25, drift, ways).estimate()
    assert estimate
    true = 3600.25 + drift * estimate.time
    assert abs(estimate.offset - true) <= estimate.offset_uncertainty + 1e-8
    assert abs(estimate.drift - drift) <= estimate.drift_uncertainty
    assert estimate.offset_at(estimate.time + 2) == pytest.approx(
        estimate.offset + 2 * estimate.drift
    )


def test_queues_hardly_count() -> None:
    """The bound comes from the quickest exchange: .2 ms each way, with queues of 5 ms in the
    mean."""
    estimate = estimated(-5.0, 0.0, (5, 5)).estimate()
    assert estimate
    assert estimate.offset_uncertainty < 0.5e-3
    assert abs(estimate.drift) < 1e-4


def test_without_an_exchange_there_is_no_estimate() -> None:
    clock = ClockFilter()
    assert clock.estimate() is None
    clock.add(0, 1005 * MS, 1006 * MS, 11 * MS)
    estimate = clock.estimate()
    assert estimate
    assert estimate.offset == pytest.approx(1.0)
    assert estimate.offset_uncertainty == pytest.approx(0.005)
    assert (estimate.drift, estimate.drift_uncertainty) == (0.0, 500e-6)
