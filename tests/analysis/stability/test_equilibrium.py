"""Which equilibrium a scene is judged at, against where runs of the FMUs rest."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability import loaded_variants
from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.trajectory import Trajectory, trajectory
from tests.analysis.stability.test_virtual_coupling import HELD, POINT

LINKAGES = Path(__file__).parents[3] / "studies" / "mismatch" / "linkages"
FOUR_BAR, SLIDER_CRANK = LINKAGES / "four-bar.toml", LINKAGES / "slider-crank.toml"


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
def test_it_is_the_one_at_which_the_run_rests(scene: str | Path, options: dict[str, Any]) -> None:
    """Newton's method from the start of these scenes ends at others, which are unstable."""
    options |= {"duration": 12.0}
    found = hl.equilibrium_stability(scene, options)
    run = hl.run(scene, options, figures=False)
    x, time = run["virtual_mechanism.x"], run.time("virtual_mechanism.x")
    assert np.abs(run["virtual_mechanism.qd"][-2:]).max() < 1e-3
    assert found.verdict == "stable"
    assert found.where.run == "rests there"
    assert found.where.pose == pytest.approx(x[-1], abs=1e-5)
    way = x[-1] - x[0]
    start = found.where.from_start.by
    assert (start["m"], start["rad"]) == pytest.approx((np.hypot(*way[:2]), abs(way[2])), abs=1e-5)
    off = np.abs(x - x[-1]).max(axis=1)
    assert off[time >= found.where.time].max() < 1e-3
    assert off[time < found.where.time - 1.0].max() > 1e-3


def test_what_presses_is_told_with_its_depth() -> None:
    options = held("spring", 858.6, 37.25, -0.045, 0.0002, -0.329, turn=1.0) | {
        "duration": 4.0,
        "graphics.rate": 16,
        "contacts.enclosure": [[-0.022, 0.0], [0.018, 0.0], [0.018, 0.042], [-0.022, 0.042]],
        "contacts.stiffness": 1000.0,
        "contacts.damping": 10.0,
        "controller.contact": True,
    }
    found = hl.equilibrium_stability(SLIDER_CRANK, options)
    run = hl.run(SLIDER_CRANK, options, figures=False)
    (depth,) = found.where.contacts.values()
    assert list(found.where.contacts) == ["rod on enclosure"]
    assert depth == pytest.approx(-run["virtual_mechanism.contact_gap"][-1], rel=1e-3)
    assert f"in contact: rod on enclosure ({1e3 * depth:.2g} mm)" in next(found.where.lines())


def test_a_run_that_grows_away_is_told() -> None:
    """A wall that is too stiff, against which the handle hops: its rest is 2 N/K deep."""
    options = {"fmu.wall.start.stiffness": 6000.0, "linkage.start.rail": 0.0003}
    found = hl.equilibrium_stability("virtual-wall", options)
    assert found.where.pose[0] == pytest.approx(2 / 6000)
    assert found.where.run == "passes"
    assert "the run from the start has not come to rest there" in "\n".join(found.lines())
    run = hl.run("virtual-wall", options, figures=False)
    x, time = run["virtual_mechanism.x"][:, 0], run.time("virtual_mechanism.x")
    near = x[np.argmin(np.abs(time - found.where.time))]
    assert found.where.nearest.by["m"] == pytest.approx(abs(near - 2 / 6000), abs=1e-6)


def test_a_run_that_diverges_is_told_with_the_time_of_the_run() -> None:
    """The search runs a period again and again, each by the clock of the first one."""
    options = {
        "duration": 4.0,
        "hand": {"type": "arm", "target": [[0.0, 0.0445, 0.0148, -0.788]]},
        "controller.teleoperation.stiffness": [600.0, 600.0, 0.6],
    }
    run = hl.run("closed-loop-direct", options, figures=False)
    assert run.fault
    found = hl.equilibrium_stability("closed-loop-direct", options)
    assert found.where.ended.split(" at t = ")[1] == str(run.fault).split(" at t = ")[1]


@pytest.mark.parametrize(("damping", "found"), [(0.6, True), (0.7, False)])
def test_a_limit_cycle_that_divides_the_period_is_no_rest(damping: float, found: bool) -> None:
    """A coupling beyond the limit of test_virtual_coupling.py shakes at half the haptic rate until
    the motors saturate: after the 16 ticks of a period each state is the same."""
    options = HELD | {
        "graphics.rate": 32,
        "duration": 2.0,
        "hand.target": [[0.0, *POINT[:2], POINT[2] + 1e-3]],
        "controller.teleoperation.damping": [70.0, 70.0, damping],
    }
    run = hl.run("closed-loop", options, figures=False)
    speed = run["virtual_mechanism.qd"][-17:, 3]
    assert speed[-1] == pytest.approx(speed[-17], rel=1e-4)
    assert speed[-1] == pytest.approx(-speed[-2], rel=1e-3)
    if not found:  # every search ends in the cycle
        with pytest.raises(hl.InputFault, match=r"limit cycle that repeats after 0\.03125 s"):
            hl.equilibrium_stability("closed-loop", options)
        return
    at = hl.equilibrium_stability("closed-loop", options)
    assert at.verdict == "unstable"
    assert at.where.run == "passes"


def test_an_arm_that_shakes_between_the_limits_of_motors_does_not_rest() -> None:
    """The pose of this run settles, while the speeds change their sign from tick to tick."""
    options = SERIAL | {"duration": 8.0}
    run = hl.run("serial", options, figures=False)
    x, qd = run["virtual_mechanism.x"], run["virtual_mechanism.qd"]
    assert x[-1] == pytest.approx(x[-512], abs=1e-5)
    assert qd[-1, 1] == pytest.approx(-qd[-2, 1], rel=1e-3)
    assert abs(qd[-1, 1]) > 1.0
    found = hl.equilibrium_stability("serial", options)
    assert found.verdict == "unstable"
    assert found.where.run == "passes"


def test_a_run_that_has_not_grown_yet_does_not_rest() -> None:
    """A wall that is too stiff in both directions, off its rest by 1 nm."""
    options = {
        "fmu.wall.settings.unilateral": False,
        "fmu.wall.start.stiffness": 6000.0,
        "linkage.start.rail": 2 / 6000 + 1e-9,
        "duration": 0.5,
    }
    found = hl.equilibrium_stability("virtual-wall", options)
    assert found.verdict == "unstable"
    assert found.where.run == "passes"


def test_a_moving_target_is_told_before_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def search(self: LiftedMap, *given: Any, **options: Any) -> NoReturn:
        raise AssertionError("a search has begun")

    monkeypatch.setattr(LiftedMap, "slopes", search)
    with pytest.raises(hl.InputFault, match="moves with time"):
        hl.equilibrium_stability("two-hands")


def test_a_variant_without_an_equilibrium_nearby_is_run_from_its_own_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And not from where the variant before was when its map began."""
    begun: list[np.ndarray] = []

    def run(map_: LiftedMap, seconds: float) -> Trajectory:
        begun.append(map_.start)
        return trajectory(map_, seconds)

    monkeypatch.setattr(loaded_variants, "nearby", lambda map_, state: None)
    monkeypatch.setattr(loaded_variants, "trajectory", run)
    scene = hl.scene("virtual-wall", {"linkage.start.rail": 0.001, "duration": 1.0})
    soft, stiff = ([f"fmu.wall.start.stiffness={K}"] for K in (1000, 4000))
    for variants in ((soft, stiff), (stiff,)):
        with loaded_variants.LoadedVariants(scene) as judge:
            for variant in variants:
                judge.judge(variant)
    assert begun[1] == pytest.approx(begun[2], rel=1e-12, abs=1e-15)
    assert len(begun) == 3
