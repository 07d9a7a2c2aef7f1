"""What a hand would notice of a run: thresholds on signals that are known, and on runs."""

from __future__ import annotations

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.noticed import FAINTEST, SHAKING, shaking, tracking_noticed
from hapticlink.analysis.findings.summary import numbers
from hapticlink.orchestrator.base.arrays import Vector

T = 1 / 512
TIME = np.arange(1025) * T
DEGREES = np.pi / 180


def turned(force: float, degrees: float) -> Vector:
    return np.array([force * np.cos(degrees * DEGREES), force * np.sin(degrees * DEGREES)])


@pytest.mark.parametrize(
    ("hand", "right", "is_noticed"),
    [
        (turned(5.0, 0.0), turned(5.0 / 0.91, 0.0), False),  # 9 % too small
        (turned(5.0, 0.0), turned(5.0 / 0.89, 0.0), True),
        (turned(5.0, 0.0), turned(5.0 / 1.09, 0.0), False),
        (turned(5.0, 0.0), turned(5.0 / 1.11, 0.0), True),
        (turned(5.0, 40.0), turned(5.0, 15.0), False),  # 25 degrees
        (turned(5.0, 40.0), turned(5.0, 66.5), True),
        (turned(5.0, 170.0), turned(5.0, 195.0), False),  # across 180 degrees
        (turned(0.0, 0.0), turned(0.24, 70.0), False),  # a weak force: a quarter of a newton
        (turned(0.0, 0.0), turned(0.26, 70.0), True),
        (turned(0.3, 0.0), turned(0.3, 48.0), False),  # .24 N between them, turned by 48 degrees
        (turned(0.3, 0.0), turned(0.3, 52.0), True),
    ],
)
def test_a_force_is_noticed_from_its_threshold_on(
    hand: Vector, right: Vector, is_noticed: bool
) -> None:
    F, E = (np.tile(each[:, None], len(TIME)) for each in (hand, right - hand))
    found = tracking_noticed(TIME, F, E)
    assert found is not None
    assert found.seconds == (pytest.approx(found.of) if is_noticed else 0.0)
    assert found.error == pytest.approx(np.hypot(*(right - hand)))
    assert found.force == pytest.approx(np.hypot(*hand))


def test_a_force_is_averaged_over_a_period_of_vibration() -> None:
    F, E = np.zeros((2, len(TIME))), np.zeros((2, len(TIME)))
    E[0, 300] = 3.0  # within one of 13 ticks
    found = tracking_noticed(TIME, F, E)
    assert found is not None
    assert found.seconds == 0.0
    E[0, 300:303] = 3.0
    found = tracking_noticed(TIME, F, E)
    assert found is not None
    # two of them are in 12 of the means of 13, three in 11
    assert found.seconds == pytest.approx(13 * T)
    assert found.time == pytest.approx(TIME[301], abs=13 * T / 2)


def velocities(hertz: float, amplitude: float, turn: float = 0.6) -> Vector:
    """The velocity of a point whose acceleration along a line is held over each T, and has an
    amplitude (m/s2) at a frequency, by the Fourier integral over one period of the hold."""
    w = 2 * np.pi * hertz
    first = abs(np.exp(1j * w * (np.arange(4096) + 0.5) / 4096 * T).mean())
    held = amplitude / first * np.cos(w * TIME + 0.3)
    return turned(1.0, turn / DEGREES)[:, None] * np.cumsum(T * held)


@pytest.mark.parametrize("hertz", [47.0, 60.0, 100.0, 171.3, 240.0])
def test_shaking_is_the_amplitude_of_the_acceleration(hertz: float) -> None:
    found = shaking(TIME, velocities(hertz, 0.4))
    assert found is not None
    assert found.amplitude == pytest.approx(0.4, rel=0.02)


@pytest.mark.parametrize(("hertz", "amplitude"), [(0.5, 2.0), (2.0, 8.0), (5.0, 10.0), (20.0, 2.0)])
def test_a_motion_of_a_hand_is_no_shaking(hertz: float, amplitude: float) -> None:
    found = shaking(TIME, velocities(hertz, amplitude))
    assert found is not None
    assert found.amplitude < FAINTEST / 2


@pytest.mark.parametrize("before", [0, 6], ids=["at once", "late in a long run"])
def test_shaking_that_lasts_for_a_while_is_found_where_it_is(before: int) -> None:
    """And what is no number, as of a run that diverges, is no shaking."""
    periods = velocities(1.0, 3.0)[:, :-1]
    v = np.tile(periods, before + 1)
    v[:, -periods.shape[1] :] += (velocities(80.0, 0.4) * ((TIME > 1.7) & (TIME < 1.96)))[:, :-1]
    v = np.hstack([v, np.full((2, 512), np.nan)])
    found = shaking(T * np.arange(v.shape[1]), v)
    assert found is not None
    assert found.amplitude == pytest.approx(0.4, rel=0.1)
    assert found.time == pytest.approx(1.83 + 2.0 * before, abs=0.05)


@pytest.mark.parametrize("time", [TIME[:100], TIME[::8]], ids=["short", "seldom"])
def test_what_rows_cannot_show_is_not_told(time: Vector) -> None:
    assert shaking(time, np.zeros((2, len(time)))) is None


def test_shaking_of_a_run_is_that_of_its_path() -> None:
    """A hand that shakes by 60 Hz: a sine through the positions, whose spectrum nothing else
    uses."""
    made = hl.run(
        "closed-loop-ideal",
        {
            "duration": 1.0,
            "hand": {
                "type": "profile",
                "table": {"amplitude": [3.0, 1.5, 0.0], "frequency": [60.0, 60.0, 0.0]},
            },
        },
    )
    table, found = made["haptics"], made.run["noticed"][""]["shaking"]
    near = np.abs(table["time"] - found["time"]) < 0.06
    time, x = table["time"][near] - found["time"], table["haptic_device.x_true"][near, :2]
    w = 2 * np.pi * 60.0
    basis = np.stack([np.sin(w * time), np.cos(w * time), *np.vander(time, 4).T], axis=1)
    amplitude = w * w * np.linalg.norm(np.linalg.lstsq(basis, x, rcond=None)[0][:2])
    assert amplitude > SHAKING
    assert found["amplitude"] == pytest.approx(amplitude, rel=0.03)
    assert "would notice shaking (" in "\n".join(numbers(made))


def test_the_force_of_the_tracking_error_is_what_the_hand_lacks() -> None:
    """With the velocity terms compensated the handle accelerates as the mechanism does under F_h +
    F_drift: the premise of what is said, from the path of the handle alone."""
    options = {"controller.bias": "full", "graphics.rate": 512, "controller.topology": False}
    made = hl.run("closed-loop-ideal", options | {"duration": 1.0})
    table, other = made["haptics"], made["graphics"]
    v, F = table["haptic_device.v_true"], table["hand.F"] + table["controller.F_drift"]
    a = np.diff(v, axis=0) / T
    mobility = np.array(
        [
            other["virtual_environment.Lambda_inv"][np.searchsorted(other["time"], t + 1e-9) - 1]
            for t in table["time"][:-1]
        ]
    )
    foretold = np.einsum("kij,kj->ki", mobility, F[:-1]) + table["virtual_mechanism.a_bias"][:-1]
    assert np.abs(a - foretold).max() < 0.02 * np.abs(a).max()
    assert np.abs(a - np.einsum("kij,kj->ki", mobility, table["hand.F"][:-1])).max() > 0.1


def test_velocity_terms_that_are_left_out_are_noticed() -> None:
    """The report leaves them out, and its tracking error is then ten times as large."""
    without, full = (
        hl.run("closed-loop-ideal", {"controller.bias": bias}) for bias in ("none", "full")
    )
    assert without.run["noticed"][""]["tracking"]["seconds"] > 0.1
    assert full.run["noticed"][""]["tracking"]["seconds"] == 0.0
    line = next(line for line in numbers(full) if "attentive" in line)
    assert "not the tracking error (" in line


def test_only_the_tracking_error_of_an_impedance_law_is_judged() -> None:
    """Without it the coupling's force is what the hand is to feel."""
    made = hl.run("closed-loop-ideal", {"controller.impedance": False, "duration": 0.5})
    found = made.run["noticed"][""]
    assert found["tracking"] is None
    assert found["shaking"] is not None
    assert not hl.run("five-bar", {"duration": 0.5}).run["noticed"]
