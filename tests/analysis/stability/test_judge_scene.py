"""The verdict over poses and hands, against closed forms, against maps that are linearised whole,
and against FMUs that are loaded in place of what is substituted."""

from __future__ import annotations

import math
import shlex
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn
from unittest.mock import Mock

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.search.settings import Scales
from hapticlink.analysis.stability import (
    forward_sensitivity,
    judge_scene,
    margin_and_remedy,
)
from hapticlink.analysis.stability.hand_cases import Case, InHands, in_poses, worst_case
from hapticlink.analysis.stability.hand_slopes import hand_slopes
from hapticlink.analysis.stability.hands import HANDS, OWN, free
from hapticlink.analysis.stability.lifted_map import long_enough, open_lifted_map
from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.margin_and_remedy import SAFE, Margin, _Search, improvements
from hapticlink.analysis.stability.mechanism_alone import growth_alone
from hapticlink.analysis.stability.modes import DRIFT, Mode, kind, modes
from hapticlink.analysis.stability.poses import (
    Pose,
    at_pose,
    choose_evenly_spaced,
    find_rest_pose,
    simulate_scene,
    visited_poses,
)
from hapticlink.analysis.stability.resting_scene import RestingScene, resting
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.smooth_scene import linearisable, with_quicker_fmus
from hapticlink.analysis.stability.verdict_record import Stability
from hapticlink.commands.progress import steps
from hapticlink.components.blocks.start_settings import without_start_values
from hapticlink.components.device.models import device_model
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import ArmHand, Hand, SpringHand
from hapticlink.fmus.blocks import find_block, has_compiled
from hapticlink.orchestrator.base.errors import FmuFault, InputFault, Interrupted
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system import fmu_files
from hapticlink.orchestrator.system.build_system import build_system
from tests.analysis.stability.own_hand import linearised
from tests.mechanisms import standing_rod

POINT = (0.044493, 0.014823, -0.788148)
FIRM = {"type": "spring", "stiffness": [1000.0, 1000.0, 3.0], "damping": [5.0, 5.0, 0.01]}
SCENE = {"graphics.rate": 64, "hand": {**FIRM, "target": [[0.0, *POINT]]}}
LEADING = 6
COUNTS: list[tuple[str, dict[str, Any], tuple[int, int, int]]] = [
    ("closed-loop-ideal", {}, (20, 86, 2838)),
    ("closed-loop-ideal", {"hold": "foh"}, (20, 95, 6373)),
    ("serial", {}, (31, 115, 2497)),
    ("enclosure", {}, (18, 110, 1640)),
    ("two-users", {}, (15, 95, 1479)),
    ("closed-loop-direct", {}, (43, 198, 3906)),
    ("closed-loop-direct", {"hold": "foh"}, (45, 221, 7491)),
]
Judged = tuple[hl.Stability, list[tuple[str, int, int]], SharedWork]
BEYOND: dict[str, Any] = {"fmu.wall.start.stiffness": 20000.0, "packaging": "native"}


def counted(work: SharedWork) -> tuple[int, ...]:
    return tuple(work.counts[of] for of in ("equilibria", "differentiated", "products"))


@pytest.fixture(scope="module")
def beyond() -> Judged:
    """The verdict on a wall beyond its limit, what it told meanwhile, and how it was found."""
    told: list[tuple[str, int, int]] = []
    work = SharedWork()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judge_scene, "SharedWork", lambda run: replace(work, run=run))
        found = hl.stability("virtual-wall", BEYOND, poses=1, progress=lambda *s: told.append(s))
    return found, told, work


@pytest.fixture(scope="module")
def place() -> Iterator[RestingScene]:
    with resting("closed-loop-direct", SCENE) as found:
        yield found


def leading(period: LinearPeriod) -> list[complex]:
    return [mode.z for mode in modes(period.linear, period.map_.period)[:LEADING]]


def test_events_that_repeat_have_the_map_that_is_carried_through_the_period(
    place: RestingScene,
) -> None:
    """By another road: differences of the whole map, for all coordinates in their turn."""
    period = place.period({})
    whole = linearised(place.map, period.point)
    expected = [mode.z for mode in modes(whole, place.map.period)[:LEADING]]
    assert leading(period) == pytest.approx(expected, abs=1e-6)


def test_acts_that_are_joined_for_all_hands_have_the_modes_of_each_hand(
    place: RestingScene,
) -> None:
    period = place.period({})
    fused = period.fused(["hand"])
    assert leading(fused) == pytest.approx(leading(period), rel=1e-9)
    for hand in HANDS.values():
        slopes = {"hand": hand_slopes(hand, place.T)}
        held = leading(period.held(slopes))
        assert leading(fused.held(slopes)) == pytest.approx(held, rel=1e-9)


def test_slopes_that_are_taken_over_stay_within_what_a_growth_rate_is_uncertain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Against slopes that are found anew at each of the numbers and at each age: those of holds on
    manifolds change on the way to the equilibrium."""
    read = hl.scene("closed-loop-ideal", {"hold": "foh", "graphics.rate": 128})
    assert read.linkage is not None
    poses = [find_rest_pose(read, read.linkage)]
    taken_over, _ = in_poses(read, poses, HANDS, DRIFT)
    monkeypatch.setattr(forward_sensitivity, "SAME", 1e-13)
    monkeypatch.setattr(forward_sensitivity, "is_polynomial", lambda hold: False)
    anew, _ = in_poses(read, poses, HANDS, DRIFT)
    assert [case.growth for case in taken_over] == [
        pytest.approx(case.growth, abs=0.1 * case.uncertainty) for case in anew
    ]


@pytest.mark.parametrize("scene", ["geared-five-bar", "closed-loop-direct"])
def test_a_pose_is_that_of_a_scene_that_starts_there_by_the_fmus_of_the_scenes_own_start(
    scene: str,
) -> None:
    linkage = hl.scene(scene).linkage
    assert linkage is not None
    files = set()
    for pose in choose_evenly_spaced(simulate_scene(scene, ("duration=0.5",)), linkage, 3):
        with resting(scene, pose.started | pose.held) as there:
            start, expected = there.map.start, leading(there.period({}))
        with resting(scene, pose.held, at=pose.start) as moved:
            assert moved.map.start == pytest.approx(start, abs=1e-9)
            assert leading(moved.period({})) == pytest.approx(expected, abs=1e-9)
            fmus = moved.map.system.fmus
        files.add(tuple(f.description.path for f in fmus if f.name != "hand"))
    assert len(files) == 1


def test_a_hand_in_place_of_another_has_the_map_of_its_own_fmu(place: RestingScene) -> None:
    arm: dict[str, Any] = {"type": "arm", "target": [[0.0, *POINT]]}
    spec = ArmHand(target=((0.0, 0.0, 0.0, 0.0),))
    in_arm = place.period({}).held({"hand": hand_slopes(spec, 1 / 512)})
    options = {**SCENE, "hand": arm}
    with (
        linearisable("closed-loop-direct", options) as (read, system, _),
        open_lifted_map(long_enough(read, system), read) as map_,
    ):
        loaded = modes(linearised(map_, map_.start), map_.period)[:LEADING]
    assert leading(in_arm) == pytest.approx([mode.z for mode in loaded], abs=1e-4)


@pytest.mark.parametrize(("hold", "late"), [("zoh", 1), ("foh", 3)])
def test_a_delay_in_place_of_none_has_the_map_of_late_forces(hold: str, late: int) -> None:
    """Of late samples, too, but where a hold extrapolates these further."""
    given = SCENE | {"hold": hold}
    with resting("closed-loop-direct", given) as place:
        connections = place.map.system.connections
        found = leading(place.period({}).delayed("controller", late))

    def as_loaded(delayed: Iterable[str]) -> list[complex]:
        options = given | {"delays": dict.fromkeys(delayed, late / 512)}
        with resting("closed-loop-direct", options) as loaded:
            return leading(loaded.period({}))

    forces = as_loaded(c.name for c in connections if c.source == "controller")
    samples = as_loaded(c.name for c in connections if c.target == "controller")
    assert found == pytest.approx(forces, abs=1e-5)
    assert (found == pytest.approx(samples, abs=1e-5)) == (hold == "zoh")


def test_the_scenes_own_hand_has_the_eigenvalues_of_its_sampled_spring() -> None:
    """m = 1, K = 100, T = 0.05: z^2 - (2 - alpha/2) z + 1 + alpha/2 with alpha = K T^2/m."""
    with resting("sampled-spring", {"hand": {**FIRM, "target": [[0.0, 0.0, 0.0, 0.0]]}}) as found:
        own = SpringHand(stiffness=(100.0, 0.0, 0.0))
        (case,) = InHands(found).cases("start", {OWN: own}, DRIFT)
    z = max(np.roots([1.0, -(2 - 0.125), 1.125]), key=lambda root: root.imag)
    assert case.growth == pytest.approx(math.log(abs(z)) / 0.05, rel=1e-6)
    assert case.hertz == pytest.approx(np.angle(z) / 0.05 / (2 * np.pi), rel=1e-6)
    assert (case.verdict, case.kind) == ("unstable", "oscillation")


def test_a_free_slider_decays_by_its_damper_alone() -> None:
    """m v' = -b v, exact over T with the force b v held: v_{k+1} = (1 - b T/m) v_k."""
    rate, b, m = 512.0, 4.0, 1.0
    options = {"haptics.rate": rate, "hand": {**FIRM, "target": [[0.0, 0.0, 0.0, 0.0]]}}
    with resting("sampled-spring", options) as found:
        (case,) = InHands(found).cases("start", {"damper": free(b)}, DRIFT)
    assert case.growth == pytest.approx(rate * math.log(1 - b / m / rate), rel=1e-6)
    assert case.verdict == "stable"


@pytest.mark.parametrize(
    ("growth", "hertz", "said"),
    [(0.1, 0.5, "drift"), (0.3, 0.5, "divergence"), (0.1, 2.0, "oscillation"),
     (0.1, 60.0, "vibration")],
)  # fmt: skip
def test_modes_are_told_apart(growth: float, hertz: float, said: str) -> None:
    assert kind(growth, hertz, DRIFT) == said


def test_of_cases_that_differ_by_rounding_the_first_is_the_worst() -> None:
    def case(hand: str, growth: float) -> Case:
        return Case("0 s", hand, growth, 1e-4, 1.0, "oscillation", "stable", ())

    for growth in (-0.5, -0.5000000005, 3.25, 0.0):  # the second is cut by rounding to 9 digits
        for less in (-1e-14, 1e-14):
            tie = [case("light touch", growth), case("firm grip", growth + less)]
            assert worst_case(tie) is tie[0]
    tie = [case("light touch", -0.5), case("firm grip", -0.5 * (1 - 1e-14))]
    assert worst_case([*tie, case("stiff arm", -0.4999)]) is not tie[0]


@pytest.mark.parametrize(
    ("margin", "told"),
    [
        (
            Margin(0.0, None, math.inf),
            "stable with no stiffnesses tried, down to times 0.001, "
            "stable at no graphics rate tried",
        ),
        (
            Margin(1.29, 0.0, 30.0),
            "stiffnesses times 1.2, less than a haptic period of further delay in the controller, "
            "graphics down to 30 Hz in whole haptic periods",
        ),
        (
            Margin(8.77, 0.001953125, 512 / 35),
            "stiffnesses times 8.7, 1.95 ms of further delay in the controller, "
            "graphics down to 14.7 Hz in whole haptic periods",
        ),
        (
            Margin(1024.0, 0.015625, 8.0, ("stiffness", "delay", "rate")),
            "stiffnesses at least times 1000 (not searched further), "
            "at least 15.6 ms of further delay in the controller (not searched further), "
            "graphics at least down to 8 Hz in whole haptic periods (not searched further)",
        ),
    ],
)
def test_a_margin_is_told_on_its_safe_side_and_as_far_as_it_was_searched(
    margin: Margin, told: str
) -> None:
    """512/35 = 14.63: at 14.6 Hz it is unstable."""
    assert ", ".join(Stability._margins(Mock(margin=margin))) == told


def test_motors_at_their_limit_leave_the_hand_the_bare_device() -> None:
    """A grip of 30 N.s/m and 4,000 N/m that is sampled holds the device's mass M alone: v and x
    after a step with a constant force are v + T a and x + T v + T^2/2 a, a = -M^-1 (b v + k x). The
    arm behind the grip moves little."""
    joints = dict(shoulder1=3.445051, elbow1=-0.944812, shoulder2=-3.311094, elbow2=6.283920)
    scene = {"device.extends": "pantograph-mk-ii", "controller.bias": "full", "graphics.rate": 512}
    read = hl.scene("closed-loop-ideal", scene)
    point = (-0.056908, 1.3e-5, 2.500239)  # where the linkage is stretched
    pose = Pose(0.0, joints, point, (-0.5, 0.0, 0.0), title="pulled")
    stiff = "stiff arm, firm grip"
    (case,), _ = in_poses(read, [pose], {stiff: HANDS[stiff]}, DRIFT)
    assert case.saturated
    assert case.hertz == 256.0
    M = np.array(hand_mass(read.device, point))
    T, k, b, one = 1 / 512, 4000.0, 30.0, np.eye(2)
    a = np.linalg.inv(M)
    step = np.block(
        [[one - a * b * T, -a * k * T], [one * T - a * b * T**2 / 2, one - a * k * T**2 / 2]]
    )
    growth = np.log(np.abs(np.linalg.eigvals(step)).max()) / T
    assert case.growth == pytest.approx(growth, rel=0.01)
    told = Mock(
        cases=[case],
        worst=case,
        _margins=list,
        margin=Margin(None, None, None),
        remedies=(),
        without={},
    )
    assert "at pulled motors are at their limit" in [*islice(Stability._below(told), 2)][1]


def hand_mass(device: Device | None, point: tuple[float, ...]) -> ca.DM:
    """The mass matrix (kg) of a device's point."""
    assert device
    model, x = device_model(device), ca.SX.sym("x", 3)
    M, _ = model.motion(model.place_at_pose(x), ca.SX(2, 1), model.numbers)
    return ca.Function("M", [x], [M])(point)


@pytest.mark.parametrize(
    ("beyond", "known"),
    [(InputFault("it has no equilibrium"), False), (FmuFault("a", "diverges", 0.0), True)],
)
def test_gains_without_an_equilibrium_are_not_known_to_be_unstable(
    slider: hl.Scene, monkeypatch: pytest.MonkeyPatch, beyond: Exception, known: bool
) -> None:
    """Their margin is at least that with which there is one."""

    class Faulty(InHands):
        def __init__(self, place: RestingScene, scales: Scales | None = None, late: int = 0):
            if (scales or {}).get("drift", 1.0) > 1.3:
                raise beyond
            self._unused = late

        def worst(self, *_: object) -> float:
            return -1.0

    monkeypatch.setattr(margin_and_remedy, "InHands", Faulty)
    pose = choose_evenly_spaced(simulate_scene(slider), slider.linkage, 1)[0]
    case = Case(pose.name, "firm grip", -1.0, 0.0, 1.0, "oscillation", "stable", ())
    margin, _ = improvements(slider, pose, HANDS, DRIFT, case, lambda _: ([pose], ""))
    assert margin.stiffness == pytest.approx(1.3, rel=0.02)
    assert ("stiffness" not in margin.not_searched_further) == known


def test_a_margin_leaves_drifts_aside(slider: hl.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """As its line says: below it grows what is slower than 1 Hz, above it what is not."""

    class Drifting(InHands):
        def __init__(self, place: RestingScene, scales: Scales | None = None, late: int = 0):
            self._hertz, self._seconds = 0.5 * (scales or {}).get("drift", 1.0), 1 / 64

        def _leading(self, hand: Hand | None) -> tuple[Mode, Any, int]:
            growth, omega = 0.1, 2 * math.pi * self._hertz
            z = np.exp(complex(growth, omega) * self._seconds)
            mode = Mode(z, 1e-9, growth, omega, np.zeros(0), np.zeros(0))
            return mode, Mock(traced=lambda mode: mode), 0

    monkeypatch.setattr(margin_and_remedy, "InHands", Drifting)
    pose = choose_evenly_spaced(simulate_scene(slider), slider.linkage, 1)[0]
    case = Case(pose.name, "firm grip", 0.1, 0.0, 0.5, "drift", "unstable", ())
    margin, _ = improvements(slider, pose, HANDS, DRIFT, case, lambda _: ([pose], ""))
    assert margin.stiffness == pytest.approx(2.0, rel=0.02)
    told = Mock(
        cases=[case], worst=case, remedies=(), without={}, margin=margin, _margins=lambda: ["half"]
    )
    assert next(Stability._below(told)) == "margin at 0 s (drifts aside): half"


@pytest.mark.parametrize(("uncertainty", "searched"), [(0.05, True), (2.0, False)])
def test_no_margin_is_searched_where_growth_rates_are_uncertain(
    slider: hl.Scene, uncertainty: float, searched: bool
) -> None:
    """Next to a singular pose rounding decides what grows."""
    poses = choose_evenly_spaced(simulate_scene(slider), slider.linkage, 1)
    case = Case("0 s", "firm grip", 0.02, uncertainty, 1.2, "oscillation", "marginal", ())
    firm = {"firm grip": HANDS["firm grip"]}
    margin, _ = improvements(slider, poses[0], firm, DRIFT, case, lambda _: (poses, ""))
    assert (margin.stiffness is not None) == searched
    told = ", ".join(Stability._margins(Mock(margin=margin)))
    assert (told == "not searched, as growth rates there are uncertain by 2 1/s") == (not searched)


SLIDER = """
title = "Slider"
duration = 0.1

[linkage]
operational_point.body = "car"

[[linkage.body]]
name = "car"
mass = 0.6
inertia = 1e-4

[[linkage.joint]]
name = "rail"
type = "prismatic"
axis = 0.0
child = "car"
damping = 0.5

[graphics]
rate = 64

[device]

[controller.teleoperation]
stiffness = [100.0, 100.0, 0.1]
damping = [12.0, 12.0, 0.012]

[hand]
type = "spring"
stiffness = [200.0, 200.0, 1.0]
damping = [5.0, 5.0, 0.02]
"""


@pytest.fixture
def slider(tmp_path: Path) -> hl.Scene:
    """A scene of nobody else, with its mechanism at the graphics rate."""
    path = tmp_path / "slider.toml"
    path.write_text(SLIDER)
    return hl.scene(path, {"mechanism_at": "graphics"})


def test_inside_of_each_margin_a_changed_scene_is_stable_and_outside_unstable(
    slider: hl.Scene,
) -> None:
    """By another road than the search: gains, delays and rates as keys of the scene."""
    poses = choose_evenly_spaced(simulate_scene(slider), slider.linkage, 1)
    hands = {"firm grip": HANDS["firm grip"]}

    def stable(change: dict[str, Any]) -> bool:
        cases, without = in_poses(hl.scene(slider, change), poses, hands, DRIFT)
        assert not without
        return cases[0].verdict == "stable"

    (case,), _ = in_poses(slider, poses, hands, DRIFT)
    margin, _ = improvements(slider, poses[0], hands, DRIFT, case, lambda _: (poses, ""))
    assert "rate" not in margin.not_searched_further
    assert margin.stiffness
    assert margin.delay is not None
    assert margin.rate
    T, frame = 1 / 512, round(512 / margin.rate)
    late = round(margin.delay / T)
    with build_system(slider) as system:
        forces = [c.name for c in system.connections if c.source == "controller"]

    def gains(s: float) -> dict[str, Any]:
        stiffness, damping = np.array([100.0, 100.0, 0.1]), np.array([12.0, 12.0, 0.012])
        law = "controller.teleoperation"
        topology = {
            "controller.topology.stiffness": 200.0 * s,
            "controller.topology.damping": 50.0 * s**0.5,
        }
        return topology | {
            f"{law}.stiffness": (s * stiffness).tolist(),
            f"{law}.damping": (s**0.5 * damping).tolist(),
        }

    def delayed(periods: int) -> dict[str, Any]:
        return {"delays": {name: periods * T for name in forces}}

    inside = [delayed(late), gains(margin.stiffness), {"graphics.rate": f"512/{frame}"}]
    outside = [
        delayed(late + 1),
        gains(1.03 * margin.stiffness),
        {"graphics.rate": f"512/{frame + 1}"},
    ]
    assert all(map(stable, inside))
    assert not any(map(stable, outside))


@pytest.mark.parametrize(
    ("scene", "options", "expected"),
    COUNTS,
    ids=[f"{scene}-{options}" for scene, options, _ in COUNTS],
)
def test_a_verdict_takes_so_many_equilibria_slopes_and_products(
    scene: str,
    options: dict[str, Any],
    expected: tuple[int, int, int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As many on every machine, whatever numbers happen to repeat there."""
    work = SharedWork()
    monkeypatch.setattr(judge_scene, "SharedWork", lambda run: replace(work, run=run))
    hl.stability(scene, options | {"packaging": "native"})  # else as what lies in the cache
    assert counted(work) == expected


def test_poses_that_share_what_they_find_have_the_cases_of_each_alone() -> None:
    read = hl.scene("closed-loop-ideal", {"packaging": "native"})
    assert read.linkage is not None
    poses = choose_evenly_spaced(simulate_scene(read, ("duration=1",)), read.linkage, 2)
    shared, _ = in_poses(read, poses, HANDS, DRIFT, work=(work := SharedWork()))
    assert counted(work) == (2, 28, 268)
    alone = [case for pose in poses for case in in_poses(read, [pose], HANDS, DRIFT)[0]]
    assert [case.pose for case in shared] == [case.pose for case in alone]
    assert [case.growth for case in shared] == [
        pytest.approx(case.growth, abs=0.1 * case.uncertainty) for case in alone
    ]


def test_native_fmus_that_are_there_give_the_verdict_of_python_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    wall = {"fmu.wall.start.stiffness": 4000.0}
    python = hl.stability("virtual-wall", wall, poses=1)
    built = blocks(hl.scene("virtual-wall", wall)).built
    made_of = [(b.block, without_start_values(b.block, b.settings)[0]) for b in built]
    assert not any(has_compiled(*each) for each in made_of)
    hl.run("virtual-wall", {**wall, "packaging": "native", "duration": 0.01}, out=tmp_path / "run")
    assert all(has_compiled(*each) for each in made_of)
    made: list[str] = []

    def noted(*rest: Any, packaging: str, **others: Any) -> Any:
        made.append(packaging)
        return find_block(*rest, packaging=packaging, **others)

    monkeypatch.setattr(fmu_files, "find_block", noted)
    native = hl.stability("virtual-wall", wall, poses=1)
    assert {*made} == {"native", "python"}  # the hand at a pose is another block
    assert native.record() == python.record()


def test_a_verdict_that_is_interrupted_says_what_was_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: object) -> None:
        raise Interrupted

    monkeypatch.setattr(_Search, "_stable", interrupted)
    said = r"interrupted \(margins at .* \(.* 1/s in .*\); \d of \d steps were done\)"
    with pytest.raises(Interrupted, match=said), steps("stability", hidden=True) as tell:
        hl.stability("virtual-wall", poses=1, progress=tell)


def test_a_verdict_tells_what_is_judged_and_counts_its_steps(beyond: Judged) -> None:
    found, told, work = beyond
    assert counted(work) == (7, 27, 57)
    done = [k for _, k, _ in told]
    assert done == sorted(done)
    assert set(done) == set(range(done[-1] + 1))
    assert all(k < of for _, k, of in told)
    names = [what.partition(" (")[0] for what, *_ in told]
    assert names[:2] == ["the scene's own run", "pose at 0 s"]
    assert found.remedies
    assert any(name.startswith("remedy ") and name.endswith("its own run") for name in names)
    assert all(found.worst.hand in what for what, *_ in told if what.startswith("remedy"))


def test_a_wall_beyond_its_limit_is_unstable_and_its_remedy_holds(beyond: Judged) -> None:
    """A wall of K on b = 5 N.s/m is passive up to K T/2 < b (Colgate, Schenkel 1997): 5120 N/m at
    512 Hz; four times as stiff it shakes, and the remedy, as it is printed, is stable in all hands
    when it is judged anew."""
    found, *_ = beyond
    assert found.verdict == "unstable"
    assert found.worst.kind == "vibration"
    assert found.record()["growth_rate"] == found.growth == found.worst.growth > 0.0
    assert found.remedies[0].stable
    line = next(line for line in found.lines() if line.startswith("remedy: "))
    assert repr(found) == str(found)
    shown = ET.fromstring(f"<div>{found._repr_html_()}</div>")
    assert {row.findtext("td") for row in shown.iter("tr")} >= {c.hand for c in found.cases}
    assert line in {entry.text for entry in shown.iter("li")}
    pasted = shlex.split(line.removeprefix("remedy: ").rpartition(": ")[0])[1::2]
    again = hl.stability("virtual-wall", [*overrides.write_options(BEYOND), *pasted], poses=1)
    held = [c.growth for c in again.cases if not c.free and c.verdict != "marginal"]
    assert max(held) == pytest.approx(found.remedies[0].growth, rel=1e-9)
    marginal = {c.hand for c in again.cases if not c.free and c.verdict == "marginal"}
    assert {*found.remedies[0].marginal} == marginal
    hands = len({c.hand for c in again.cases if not c.free})
    edge = [replace(c, verdict="stable" if c.free else "marginal") for c in again.cases]
    assert f"marginal in {hands} hands and" in replace(again, cases=tuple(edge)).finding
    soft = [replace(c, verdict="marginal" if c.hand == edge[0].hand else "stable") for c in edge]
    said = f"stable in {hands - 1} of {hands} hands and marginal in the others, "
    assert said in replace(again, cases=tuple(soft)).finding
    assert "marginal" not in again.finding or any(c.verdict == "marginal" for c in again.cases)
    assert again.in_hands == "stable"
    assert len(found.cases) >= len(HANDS)


def test_a_mechanism_that_falls_over_is_said_to_do_so_by_itself(slider: hl.Scene) -> None:
    """The car on its rail is at rest anywhere. No remedy ends the fall of a rod in an arm that is
    softer than m g c/l^2."""
    rod, growth = standing_rod()
    falls = hl.scene(slider, {"mechanism_at": "haptics", "linkage": rod, "controller.bias": "full"})
    hands = {"arm at rest, soft grip": HANDS["arm at rest, soft grip"]}
    poses = choose_evenly_spaced(simulate_scene(falls), falls.linkage, 1)
    (case,), _ = in_poses(falls, poses, hands, DRIFT)
    assert case.verdict == "unstable"

    def fails(changed: hl.Scene) -> NoReturn:
        raise hl.InputFault("its run fails")

    margin, remedies = improvements(falls, poses[0], hands, DRIFT, case, fails)
    assert margin.alone == pytest.approx(growth, rel=1e-3)
    assert remedies == ()  # those whose run fails are none
    poses = choose_evenly_spaced(simulate_scene(slider), slider.linkage, 1)
    with at_pose(slider, poses[0]) as (place, _):
        assert growth_alone(place.period({}), DRIFT) == 0.0


def test_a_run_that_fails_is_said_first() -> None:
    """A spring of 1e7 N/m on 1 kg, sampled at 20 Hz, throws it off; at 512 Hz it swings."""
    found = hl.stability("sampled-spring", {"hand.stiffness": [1e7, 0.0, 0.0]}, poses=1)
    assert found.finding.startswith("unstable: ")
    assert found.finding.endswith("; but its own run fails")
    assert "the run has diverged" in found.record()["run_fault"]
    assert next(found.lines()).startswith("warning: its own run fails: virtual_mechanism: output ")
    calm = hl.stability("sampled-spring", {"haptics.rate": 512}, poses=1)
    assert calm.record()["run_fault"] is None
    assert "fails" not in calm.finding
    assert next(calm.lines()).startswith("hand ")


def test_a_run_without_a_pose_is_refused_with_its_own_fault() -> None:
    """What is said of it is not that poses were not recorded."""
    run = simulate_scene("sampled-spring", {"hand.stiffness": [1e7, 0.0, 0.0]})
    assert run.record.fault
    with pytest.raises(hl.InputFault, match=r"own run fails before its first pose: .*has diverged"):
        visited_poses(replace(run, tables={}))


def test_an_equilibrium_that_is_not_found_is_not_said_to_be_none() -> None:
    """At 21 Hz there is one, in which the loop rests at 21.2 Hz too; there it grows by e^26 over
    the 2.5 s after which frames and ticks repeat, and no search stays near it."""
    gains = {"stiffness": [27.22, 27.22, 0.1153], "damping": [5.899, 5.899, 0.0274]}
    lost = {
        **{f"controller.teleoperation.{key}": value for key, value in gains.items()},
        **{"haptics.rate": 256, "graphics.rate": 21.2, "hold": "lead", "stop_when": ""},
        **{"mechanism_at": "graphics", "directions_from": "mechanism"},
        **{"linkage.gravity": [0.0, -1.534], "controller.bias": "full"},
    }
    with pytest.raises(hl.InputFault, match=r"^no equilibrium is found in any pose, at 0 s: "):
        hl.stability("closed-loop-ideal", lost, poses=1)


def test_what_cannot_be_held_is_refused() -> None:
    with pytest.raises(hl.InputFault, match="--equilibrium"):
        hl.stability("closed-loop-ideal", {"graphics.rate": {"min": 20, "max": 60, "seed": 1}})
    with pytest.raises(hl.InputFault, match="poses = 0: give a whole number >= 1"):
        hl.stability("closed-loop-ideal", poses=0)
    with pytest.raises(hl.InputFault, match=r"bounds = 0\.2: give Bounds"):
        hl.equilibrium_stability("closed-loop-ideal", bounds=0.2)  # type: ignore[arg-type]


@pytest.mark.usefixtures("no_margins")
def test_rates_that_hardly_repeat_are_judged_as_they_run() -> None:
    """29.97 Hz at 512 Hz, which repeat after 100 s: what grows at 5.0 1/s in a run grew at .093 1/s
    in frames of 17 whole periods, each of which is seen a haptic period earlier."""
    scene, odd = "closed-loop-direct", {"graphics.rate": 29.97, "stop_when": ""}
    judged = hl.stability(scene, odd, poses=1)
    assert judged.rounded == (
        "judged with graphics at 29.97073 Hz: with its own rates all repeats only after 100 s"
    )
    (told,) = (c.growth for c in judged.cases if (c.pose, c.hand) == ("0 s", "firm grip"))
    x, y, angle = judged.poses[0].point
    firm = {"type": "spring", "stiffness": [1000.0, 1000.0, 10 / 3], "damping": [5.0, 5.0, 0.01]}
    off = {"hand": firm | {"target": [[0.0, x + 1e-12, y, angle]]}, "duration": 6.0}
    moved = np.abs(np.diff(hl.run(scene, odd | off)["haptic_device.x_true"], axis=0)).max(axis=1)
    peaks = np.array([moved[i : i + 256].max() for i in range(256, 1600, 256)])
    assert peaks[-1] < 1e-5
    rate = np.polyfit(0.5 * np.arange(len(peaks)), np.log(peaks), 1)[0]
    assert told == pytest.approx(rate, rel=0.03)


def test_a_hand_beside_a_pose_leaves_it_where_it_pulls_away() -> None:
    """What is a divergence to the linearisation is judged by such a run."""
    scene = hl.scene("closed-loop-ideal")
    (pose,) = choose_evenly_spaced(simulate_scene(scene, ("duration=0.1",)), scene.linkage, 1)
    assert not pose.leaves(scene, HANDS["stiff arm, firm grip"])
    elsewhere = replace(pose, point=(pose.point[0] + 0.02, *pose.point[1:]))
    assert elsewhere.leaves(scene, HANDS["light touch"])
    assert pose.leaves(scene, None)


def test_softer_gains_stand_beside_another_remedy() -> None:
    """In a firm grip of the mechanism at 18 Hz a faster loop ends what softer gains end, too, which
    are below the limit of the margin: that of 18 Hz, where frames of 28 and 29 haptic periods take
    turns, and not of frames that are all alike, with which 2.8 times the gains are stable."""
    scene = hl.scene("closed-loop-direct", ("graphics.rate=18",))
    poses = choose_evenly_spaced(simulate_scene(scene, ("duration=0.1",)), scene.linkage, 1)
    hands = {"firm grip": HANDS["firm grip"]}
    (case,), _ = in_poses(scene, poses, hands, DRIFT)
    assert case.verdict == "unstable"
    margin, remedies = improvements(scene, poses[0], hands, DRIFT, case, lambda _: (poses, ""))
    assert margin.stiffness
    softer = f"{100 * margin.stiffness / SAFE:.4g}"
    found = [r for r in remedies if f"teleoperation.stiffness=[{softer}" in r.options[0]]
    assert len(found) == 1
    assert len(remedies) == 2
    assert found[0].growth < 0.0


def test_fmus_are_compiled_for_a_verdict_where_contacts_are_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert with_quicker_fmus(hl.scene("push-disc")).packaging == "native"
    assert with_quicker_fmus(hl.scene("enclosure")).packaging == "python"
    assert with_quicker_fmus(hl.scene("closed-loop-ideal")).packaging == "python"
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")  # each pose would compile them again
    assert with_quicker_fmus(hl.scene("push-disc")).packaging == "python"


def test_a_mechanism_alone_is_told_that_it_has_no_loop() -> None:
    with pytest.raises(hl.InputFault, match="a mechanism alone, without a sampled loop"):
        hl.stability("pendulum")
