"""Passivity of the user's port against the closed form of Colgate and Schenkel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability import wall_limits
from hapticlink.analysis.stability.port_response import hand_port, mechanism_port
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.system.build_system import build_system
from tests.analysis.stability.own_hand import DAMPED as WALL

T = 1 / 512
HELD: dict[str, Any] = {
    "hand": {
        "type": "spring", "stiffness": [100.0, 100.0, 0.1], "damping": [5.0, 5.0, 0.005],
        "target": [[0.0, 0.035, 0.025, -0.785]],
    }
}  # fmt: skip


@pytest.mark.parametrize(
    ("K", "B", "late", "needed"),
    [
        (3000.0, 2.0, 0, 3000 * T / 2 + 2),
        (5000.0, 0.5, 0, 5000 * T / 2 + 0.5),
        (2000.0, -1.0, 0, 2000 * T / 2 + 1),
        (1000.0, 0.0, 1, 1000 * (T / 2 + T)),
        (1000.0, 3.0, 1, None),
    ],
)
def test_a_wall_needs_the_damping_of_the_closed_form(
    K: float, B: float, late: int, needed: float | None
) -> None:
    """b > K T/2 + |B|, with a delay and no damper K (T/2 + t_d); else the largest of the formula
    over the frequency. The device has 5 N.s/m."""
    gains = {"fmu.wall.start.stiffness": K, "fmu.wall.start.damping": B}
    found = hl.passivity("virtual-wall", WALL | gains | {"delays": {"wall.F": late * T}})
    form = wall_limits.passive_damping(T, late, np.array([K]), np.array([B]))[0]
    assert found.needed == pytest.approx(needed or form, rel=1e-3)
    assert found.needed > (needed or form) * (1 - 1e-6)
    shown = float(next(found.lines()).partition("damping of ")[2].partition(" ")[0])
    assert found.needed <= shown * (1 + 1e-8)
    assert shown <= found.needed * (1 + 1e-4)
    assert found.own == pytest.approx(5.0, rel=1e-3)
    assert found.passive == (found.needed <= 5.0)
    assert found.turning == 0.0


def test_a_mechanism_alone_gives_energy_to_no_hand() -> None:
    """With the wall left out of the loop (K = B = 0) nothing is needed."""
    gains = {"fmu.wall.start.stiffness": 0.0, "fmu.wall.start.damping": 0.0}
    found = hl.passivity("virtual-wall", WALL | gains)
    assert found.needed == pytest.approx(0.0, abs=1e-6)


def test_a_scene_without_a_hand_on_a_device_has_no_port() -> None:
    with pytest.raises(hl.InputFault, match="no port of a user"):
        hl.passivity("pendulum")


def test_of_two_users_it_tells_what_is_left_as_at_the_equilibrium() -> None:
    """The cut of the first user's mechanism holds the second one's point, and what is sent of the
    forces there: the result names these outputs."""
    scene = open_scene.load("two-users", {"directions_from": "mechanism"})
    with build_system(scene) as system:
        port = mechanism_port(system, hand_port(system))
    assert port is not None
    assert {"F_env", "left.x", "left.v", "left.F_env"} <= set(port.kept)
    assert not {"x", "v"} & set(port.kept)


def test_too_many_forces_are_refused_before_anything_is_searched() -> None:
    """256 haptic periods in a frame, three entries each; a path that never rests would be the later
    fault. The remedy names a rate."""
    with pytest.raises(hl.InputFault, match=r"at most 600: .* --set graphics\.rate=32"):
        hl.passivity("two-users", {"graphics.rate": 2})


def test_a_rate_that_hardly_repeats_is_judged_with_frames_between_ticks() -> None:
    """17 haptic periods are a frame of 30.118 Hz. Its damping is on the line through those of rates
    at which nothing is rounded; that of frames that end on ticks is 1.3 % below."""
    rates = ("1024/35", "2048/69", 30)
    near = [hl.passivity("closed-loop-ideal", {"graphics.rate": rate}) for rate in rates]
    assert [bool(each.rounded) for each in near] == [False, False, True]
    assert "30.11765 Hz" in near[2].rounded
    assert near[2].rounded in "".join(near[2].lines())
    line = np.polyfit([1024 / 35, 2048 / 69], [each.needed for each in near[:2]], 1)
    assert near[2].needed == pytest.approx(np.polyval(line, 512 / 17), rel=1e-3)


def test_a_target_that_comes_to_rest_later_is_judged_from_there() -> None:
    """A hand's target moves until 1 s: judged where the run rests."""
    path = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.004, 0.0, 0.0]]
    arm = {"type": "spring", "stiffness": [300.0, 0.0, 0.0], "damping": [5.0, 0.0, 0.0]}
    options = {k: v for k, v in WALL.items() if k != "hand.wrench"}
    options |= {"hand": arm | {"target": path}, "fmu.wall.start.stiffness": 3000.0}
    found = hl.passivity("virtual-wall", options)
    assert found.needed == pytest.approx(3000 * T / 2 + 1, rel=1e-3)


def test_at_half_the_rate_rounding_is_no_damping() -> None:
    """A force that changes its sign every period does not move the device, which has no impedance
    there: its own damping was found to be -1.5e8 N.s/m, that of rounding."""
    found = hl.passivity("closed-loop-ideal", HELD | {"graphics.rate": 512})
    assert abs(found.own) < 1.0
    assert found.needed < 10.0
    assert max(f for f, _ in found.curve) < 256.0


def test_the_hand_that_is_cut_off_does_not_matter() -> None:
    """Half the haptic rate is a harmonic of frames, next to which the device hardly moves."""
    start = [0.0, 0.0445, 0.0148, -0.788]
    hands: list[dict[str, Any]] = [
        {"type": "constant", "wrench": [0.0, 0.0, 0.0]},
        {"type": "spring", "stiffness": [300.0, 300.0, 1.0], "damping": [10.0, 10.0, 0.02]},
    ]
    hands[1]["target"] = [start]
    options = {"graphics.rate": 32}
    free, held = (hl.passivity("closed-loop-direct", options | {"hand": h}) for h in hands)
    assert held.needed == pytest.approx(free.needed, rel=0.01)
    assert held.at_least == pytest.approx(free.at_least, rel=0.01)
    assert held.own == free.own == 0.0
