"""Which equilibrium a scene is judged at, against where runs of the FMUs rest."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.equilibrium import _residual
from hapticlink.analysis.stability.resting_scene import resting
from hapticlink.analysis.stability.scene_variants import SceneVariants
from tests.analysis.stability.test_virtual_coupling import HELD, POINT

LINKAGES = Path(__file__).parents[3] / "studies" / "mismatch" / "linkages"
FOUR_BAR = LINKAGES / "four-bar.toml"


def held(kind: str, k: float, b: float, *target: float, turn: float = 0.0) -> dict[str, Any]:
    """A hand with a fixed target."""
    hand = {"type": kind, "stiffness": [k, k, turn], "damping": [b, b, 0.02]}
    return {"graphics.rate": 64, "hand": {**hand, "target": [[0.0, *target]]}}


SERIAL = held("arm", 161.7, 18.0, 0.08416, 0.05309, -1.0502, turn=1.0)


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        (FOUR_BAR, held("arm", 184.86, 15.2, 0.01118, -0.02902, 0.4355)),
        ("serial", SERIAL | {"controller.teleoperation.damping": [70.0, 70.0, 0.1]}),
    ],
)
@pytest.mark.usefixtures("no_margins")
def test_it_is_the_one_at_which_the_run_rests(scene: str | Path, options: dict[str, Any]) -> None:
    """Newton's method from the start of these scenes ends at others, which are unstable."""
    found = hl.equilibrium_stability(scene, options)
    assert isinstance(found, hl.Stability)
    run = hl.run(scene, options | {"duration": 8.0}, figures=False)
    x = run["virtual_mechanism.x"]
    assert np.abs(run["virtual_mechanism.qd"][-2:]).max() < 1e-3
    assert found.verdict == "stable"
    (pose,) = found.poses
    assert pose.point == pytest.approx(x[-1], abs=1e-4)
    assert np.abs(x[-1] - x[0]).max() > 1e-3


def test_a_limit_cycle_that_divides_the_period_is_no_rest() -> None:
    """A coupling beyond the limit of test_virtual_coupling.py shakes at half the haptic rate until
    the motors saturate: after the 16 ticks of a period each state is the same."""
    options = HELD | {
        "graphics.rate": 32,
        "hand.target": [[0.0, *POINT[:2], POINT[2] + 1e-3]],
        "controller.teleoperation.damping": [70.0, 70.0, 0.6],
    }
    run = hl.run("closed-loop-ideal", options | {"duration": 2.0}, figures=False)
    speed = run["virtual_mechanism.qd"][-17:, 3]
    assert speed[-1] == pytest.approx(speed[-17], rel=1e-4)
    assert speed[-1] == pytest.approx(-speed[-2], rel=1e-3)
    with pytest.raises(hl.InputFault, match=r"does not come to rest in 60 s.* at 2\.6e\+02 Hz"):
        hl.equilibrium_stability("closed-loop-ideal", options)


def test_a_run_that_diverges_has_no_rest() -> None:
    options = {
        "hand": {"type": "arm", "target": [[0.0, 0.0445, 0.0148, -0.788]]},
        "controller.teleoperation.stiffness": [600.0, 600.0, 0.6],
    }
    with pytest.raises(hl.InputFault, match=r"does not come to rest: .*diverged"):
        hl.equilibrium_stability("closed-loop-direct", options)


def test_a_variant_that_differs_in_parameters_is_set_in_the_fmus_that_are_loaded() -> None:
    """And has the radius of one that is loaded."""
    scene = hl.scene("virtual-wall", {"linkage.start.rail": 0.001})
    soft, stiff = ([f"fmu.wall.start.stiffness={K}"] for K in (1000, 4000))
    with SceneVariants(scene) as variants:
        variants.judge(soft)
        second = variants.judge(stiff)
        assert variants.loads == 1
    with SceneVariants(scene) as variants:
        assert variants.judge(stiff).radius == pytest.approx(second.radius, rel=1e-9)


@pytest.mark.parametrize("press", [(0.3, -0.1), (-0.3, -0.06)])
def test_it_is_next_to_the_start_among_those_that_lie_side_by_side(
    press: tuple[float, float],
) -> None:
    """Without topology controller a handle rests in any force that the mechanism's loop takes; next
    to such a rest, undamped steps went off along this motion until the mechanism came apart."""
    hand = {"type": "spring", "stiffness": [1000.0, 1000.0, 10 / 3], "damping": [5.0, 5.0, 0.01]}
    loose = {"graphics.rate": 64, "controller.topology": False}
    run = hl.run("closed-loop-direct", loose | {"duration": 0.05}, figures=False)
    start = run["virtual_mechanism.x"][0]
    target = (start + np.divide([*press, 1e-3], hand["stiffness"])).tolist()
    options = loose | {"hand": {**hand, "target": [[0.0, *target]]}}
    with resting("closed-loop-direct", options) as place:
        handle = place.signal("haptic_device.x")
    assert handle == pytest.approx(start, abs=6e-3)
    assert handle[:2] == pytest.approx(start[:2], abs=5e-4)


def test_without_a_free_coordinate_every_point_is_at_rest():
    """As where a page's mouse holds a linkage in space of one motion."""
    none = SimpleNamespace(V=np.zeros((2, 0)), point=np.zeros(2), change=np.zeros(0))
    assert _residual(none) == 0.0
