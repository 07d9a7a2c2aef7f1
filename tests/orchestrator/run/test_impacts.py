"""A handle that meets a virtual wall at speed: the impulse of the sampled penalty and its rebound.

A spring K that is held over T lags by T/2, which is a damping of -K T/2: the speed grows by e, and
sum F T = -m v (1 + e).
"""

import numpy as np
import pytest

from tests.shared_fixtures import run_once

MASS, T = 0.3, 1 / 512


def thrown(K, v, distance, options=None):
    """Times, velocities, and the forces of the wall, of a handle thrown at it without friction."""
    run = run_once(
        "virtual-wall",
        {
            "hand": {"type": "constant", "wrench": [0.0, 0.0, 0.0]},
            "linkage.joint.0.damping": 0.0,
            "linkage.start": {"rail": -distance},
            "linkage.start_velocity": {"rail": v},
            "fmu.wall.start.stiffness": K,
            "duration": 0.35,
        }
        | (options or {}),
    )
    assert run.fault is None
    return run["virtual_mechanism.v"][:, 0], np.ravel(run["wall.F"])


def rebound(K, v, distance):
    """The same speed by hand: a mass under a force that is held between samples."""
    x, u = -distance, v
    for _ in range(round(0.35 / T)):
        F = -K * max(x, 0.0)
        x, u = x + u * T + 0.5 * F / MASS * T**2, u + F / MASS * T
    return u


@pytest.mark.parametrize("v", [0.1, 1.0])
@pytest.mark.parametrize("K", [300.0, 3000.0])
def test_impulse_and_rebound_of_a_sampled_wall(K, v):
    speeds, F = thrown(K, v, 0.01 * v)
    e = -speeds[-1] / v
    assert e > 1.0  # it sends the handle back faster
    assert -speeds[-1] == pytest.approx(-rebound(K, v, 0.01 * v), rel=1e-9)
    assert -np.sum(F) * T == pytest.approx(MASS * v * (1 + e), rel=1e-9)


def test_a_damper_takes_what_the_samples_generate():
    """B = K T/2 takes back what the lag of half a period generates."""
    K = 300.0
    settings = {"fmu.wall.settings": {"stiffness": K, "damping": K * T / 2}}
    speeds, _ = thrown(K, 0.5, 0.005, settings)
    assert -speeds[-1] / 0.5 == pytest.approx(1.0, abs=5e-3)
    assert -thrown(K, 0.5, 0.005)[0][-1] / 0.5 > 1.04


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("samples", [1, 5])
def test_a_pulse_has_the_impulse_of_a_collision(e, samples):
    """M = m (1 + e) alone, without a spring: the handle goes back with e v."""
    pulse = {"stiffness": 0.0, "pulse": MASS * (1 + e), "pulse_duration": samples * T}
    speeds, F = thrown(0.0, 0.5, 0.005, {"fmu.wall.settings": pulse})
    assert np.count_nonzero(F) == samples
    assert -np.sum(F) * T == pytest.approx(MASS * 0.5 * (1 + e), rel=1e-9)
    assert speeds[-1] == pytest.approx(-e * 0.5, abs=1e-9)


def test_a_pulse_comes_once_a_contact():
    """A hand of 2 N holds the handle inside: a harder first contact, and the same wall at rest."""
    settings = {"fmu.wall.settings": {"stiffness": 3000.0, "pulse": 0.1, "pulse_duration": 0.004}}
    held = {"linkage.joint.0.damping": 5.0, "duration": 2.0}
    held["hand"] = {"type": "constant", "wrench": [2.0, 0.0, 0.0]}
    (_, with_pulse), (_, without) = (
        thrown(3000.0, 0.05, 0.001, held | more) for more in (settings, {})
    )
    first = np.flatnonzero(without)[0]
    assert np.flatnonzero(with_pulse)[0] == first
    assert with_pulse[first] < 2 * without[first]
    assert with_pulse[-1] == pytest.approx(-2.0, rel=0.01)
