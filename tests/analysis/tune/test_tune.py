"""Tuned gains: the felt stiffness against a closed form and against runs that press, the margin
against runs that settle.

The tunings are those of results/tune/, which take minutes; the gains,
poses, margins and compliances that they record are tried in runs of the FMUs.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hapticlink as hl
from hapticlink.analysis.search.acceptance import AcceptanceLimits, energy_share, judged_numbers
from hapticlink.analysis.search.search import COARSE, DOUBLINGS, largest_count, raise_laws
from hapticlink.analysis.stability.hands import FIRM, spring
from hapticlink.analysis.stability.poses import LIGHT, Pose, simulate_scene
from hapticlink.analysis.stability.resting_scene import resting
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.overrides import write_options
from tests.analysis.stability.own_hand import linearised

RECORDED = Path(__file__).parents[3] / "results" / "tune"
NO_ENCODER = ("device.encoder.resolution=1e-12",)
"""The map has no quantisation."""

SLIDER = """
title = "Slider at a wall"
duration = 0.5
sensing = "encoders"
haptics.rate = 512
graphics.rate = 32
hand = { type = "constant", wrench = [1.0, 0.0, 0.0] }
device = {}

[linkage]
operational_point.body = "block"
start.rail = 0.0201
body = [{ name = "block", mass = 0.8, inertia = 1e-4, radius = 0.02, capsule = [[0.0, 0.0]] }]
joint = [{ name = "rail", type = "prismatic", child = "block", axis = 0.0 }]

[controller]
topology = { stiffness = 400.0, damping = 50.0 }
contact = true
teleoperation = { stiffness = [300.0, 300.0, 1.0], damping = [20.0, 20.0, 0.1] }

[contacts]
enclosure = [[-0.04, -0.1], [0.04, -0.1], [0.04, 0.1], [-0.04, 0.1]]
stiffness = 2000.0
damping = 10.0
"""


FOUR_BAR = """
title = "Four-bar with gains that throw the handle off"
duration = 1.0
sensing = "encoders"
haptics.rate = 512
graphics.rate = 32
hand = { type = "constant", wrench = [1.0, 0.5, 0.0] }
device = {}

[linkage]
operational_point = { body = "coupler", at = [0.03, 0.01] }
start = { crank = 1.2, wrist = -0.9, rocker = 1.3 }
body = [
  { name = "crank", mass = 0.4, inertia = 8e-5, center = [0.02, 0.0] },
  { name = "coupler", mass = 0.5, inertia = 1.2e-4, center = [0.03, 0.0] },
  { name = "rocker", mass = 0.4, inertia = 1e-4, center = [0.025, 0.0] },
]
joint = [
  { name = "crank", child = "crank" },
  { name = "wrist", parent = "crank", child = "coupler", at_parent = [0.04, 0.0] },
  { name = "rocker", child = "rocker", at_parent = [0.06, 0.0] },
]
loop = [{ name = "pin", bodies = ["coupler", "rocker"], at = [[0.06, 0.0], [0.05, 0.0]] }]

[controller]
topology = { stiffness = 2000.0, damping = 50.0 }
teleoperation = { stiffness = [100.0, 100.0, 0.3], damping = [20.0, 20.0, 0.06] }
"""


def closed_form(M: NDArray[np.float64], s: complex) -> NDArray[np.complex128]:
    """The compliance (3, 3) at the handle of the slider pressed against its wall, in continuous
    time, with the inertia M of the device:

        F_o = w^2/(s^2 + k_D s + w^2) F,   e = M^-1 F_o/w^2,   v_o = s (x - e)
        m s^2 y = F_o_x - F_d_x - (k + b s) y,   M s^2 x = F + u
        u = M Lambda^-1 (F_o + F_d - (k + b s) y i) - F_o + F_T
        F_d = K (y i - x) + B (s y i - v_o),   F_T = S (P M_s^-1 P)^+ S (k_j (...) + b_j (...))

    i is the unit vector along the rail, y the slider's position.
    """
    m, k, b, w, k_D, k_j, b_j = 0.8, 2000.0, 10.0, 50.0, 100.0, 400.0, 50.0
    K, B = np.diag([300.0, 300.0, 1.0]), np.diag([20.0, 20.0, 0.1])
    Lambda_inv, i = np.diag([1 / m, 0.0, 0.0]), np.array([[1.0], [0.0], [0.0]])
    P = np.diag([0.0, 1.0, 1.0])
    N = np.linalg.pinv(P @ np.linalg.inv(M) @ P)  # S drops out: P is along its axes
    one, observed = np.eye(3), w**2 / (s**2 + k_D * s + w**2)
    lag = np.linalg.inv(M) * observed / w**2
    # F_d = D_y y - D_x x + D_F F, and the pull of the topology controller likewise
    D_y, D_x, D_F = (K + B * s) @ i, K + B * s, B * s @ lag
    T_y, T_x, T_F = (k_j + b_j * s) * i, (k_j + b_j * s) * one, b_j * s * lag
    a = m * s**2 + k + b * s + (i.T @ D_y)[0, 0]
    y_x, y_F = i.T @ D_x / a, i.T @ (observed * one - D_F) / a  # y = y_x x + y_F F
    wall = (k + b * s) * i
    left = M * s**2 - M @ Lambda_inv @ ((D_y - wall) @ y_x - D_x) - N @ (T_y @ y_x - T_x)
    right = one * (1 - observed) + M @ Lambda_inv @ (observed * one + D_F + (D_y - wall) @ y_F)
    found: NDArray[np.complex128] = np.linalg.solve(left, right + N @ (T_F + T_y @ y_F))
    return found


@pytest.fixture
def slider(tmp_path: Path) -> Path:
    path = tmp_path / "slider.toml"
    path.write_text(SLIDER)
    return path


@pytest.mark.parametrize(
    ("hertz", "rate", "most"),
    [(1.0, 512, 0.03), (2.0, 512, 0.03), (1.0, 2048, 0.01), (5.0, 2048, 0.015)],
)
def test_felt_stiffness_has_its_closed_form(
    slider: Path, hertz: float, rate: int, most: float
) -> None:
    """The closed form is the limit of high rates."""
    pose = Pose(0.0, {"rail": 0.0205}, (0.0205, 0.0, 0.0), (1.0, 0.0, 0.0))
    rates = {"haptics.rate": rate, "graphics.rate": rate // 16}
    options = rates | pose.held | pose.started
    with resting(slider, options) as place:
        X = place.compliance({}, hertz)
        assert place.signal("virtual_mechanism.F_env")[0] == pytest.approx(-1.0, abs=0.03)
        M = place.signal("haptic_device.M").reshape(3, 3)
    exact = closed_form(M, 2j * np.pi * hertz)
    for n in np.eye(3)[:2]:  # into the wall, across the rail
        assert abs(n @ X @ n) == pytest.approx(abs(n @ exact @ n), rel=most)


def test_the_first_gains_that_are_kept_feel_alike(
    slider: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And their scene loads, with an option that names an entry of an array."""
    found: list[hl.Tuned] = []

    def keep(tuned: hl.Tuned) -> None:
        found.append(tuned)
        raise KeyboardInterrupt

    monkeypatch.setattr("hapticlink.analysis.tune.tune_gains.POSES", 1)
    with pytest.raises(KeyboardInterrupt):
        hl.tune(slider, {"linkage.body.block.radius": 0.0201, "graphics.rate": 256}, keep=keep)
    felt = found[0].felt["tuned"]
    assert felt["constraint"] == pytest.approx(felt["contact"], rel=0.03)
    path = tmp_path / "tuned.toml"
    path.write_text(found[0].scene())
    read = open_scene.load(path)
    assert read.linkage.body[0].radius == 0.0201
    assert read.controller.topology.stiffness == found[0].gains["controller.topology.stiffness"]


def test_a_wild_run_is_no_measure_of_the_gains_that_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own gains generate two thirds of the hand's work at the user's port, which is no licence
    for others to generate as much."""
    scene = tmp_path / "four-bar.toml"
    scene.write_text(FOUR_BAR)
    monkeypatch.setattr("hapticlink.analysis.tune.tune_gains.POSES", 1)
    monkeypatch.setattr("hapticlink.analysis.tune.tune_gains.NEAR", {})
    monkeypatch.setattr("hapticlink.analysis.search.search.COARSE", 0.7)
    tuned = hl.tune(scene)
    own, found = (judged_numbers(simulate_scene(scene, gains)) for gains in ({}, tuned.gains))
    assert energy_share(own) > 2.0
    assert energy_share(found) <= 1.0
    device = open_scene.load(scene).device
    assert device is not None
    assert not AcceptanceLimits.of(device).why_not(found)
    assert tuned.own_run_breaks == AcceptanceLimits.of(device).why_not(own)
    assert any(tuned.own_run_breaks in line for line in tuned.lines())


def test_the_search_finds_the_largest_gains_and_tells_what_limits_them() -> None:
    limits = {"topology": 7.0, "drift": 0.3}

    def require(scales: dict[str, float]) -> None:
        for law, most in limits.items():
            if scales[law] > most:
                raise hl.InputFault(f"the limit of {law}")

    laws = ("topology", "drift")
    found, why = raise_laws(laws, {"drift": 0.1, "topology": 1.0}, require)
    assert why == "the limit of topology (topology); the limit of drift (drift)"
    for law, most in limits.items():
        assert most * np.exp(-COARSE) <= found[law] <= most
    limits["topology"] = 0.0
    with pytest.raises(hl.InputFault, match="the limit of topology"):
        raise_laws(laws, found, require)
    limits["topology"] = np.inf
    found, why = raise_laws(laws, {"drift": 0.1, "topology": 1.0}, require)
    assert found["topology"] == 2.0**DOUBLINGS
    assert "not searched further" in why


@pytest.mark.parametrize("first", [1, 3, 17, 40])
@pytest.mark.parametrize("most", [0, 1, 5, 16, 63, 64, 65])
def test_the_end_of_a_search_is_no_limit(first: int, most: int) -> None:
    """A count is found to the last that holds, and its cap as one that was not searched further."""
    asked: list[int] = []

    def holds(n: int) -> bool:
        asked.append(n)
        return n <= most

    found = largest_count(holds, first, 64)
    assert max(asked) <= 64
    assert found.limited is (most < 64)
    assert found.value == min(most, 64)


def pressed(name: str, pose: Pose, n: NDArray[np.float64], hertz: float, swing: float) -> Any:
    """The parts at a frequency of the handle's pose and the hand's force (3,) in the last second of
    a run in which the target of a firm hand swings along n."""
    push: dict[str, Any] = dict(spring(pose.point, pose.press, FIRM))
    push["target"] = {
        "mean": push["target"][0][1:],
        "amplitude": (swing * n / np.abs(n).max()).tolist(),
        "frequency": [hertz] * 3,
    }
    options = [
        *write_options(pose.started | pose.held | {"hand": push}),
        "duration=4.0",
        *NO_ENCODER,
    ]
    run = hl.run(RECORDED / name / "tuned.toml", options, figures=False)
    assert run.fault is None
    window = run.haptics["time"] > 3.0 + 1e-9
    phase = np.exp(-2j * np.pi * hertz * run.haptics["time"][window])
    signals = ("haptic_device.x_true", "hand.F")
    return np.array([(phase[:, None] * run[s][window]).mean(axis=0) for s in signals])


@pytest.mark.parametrize("name", ["closed-loop-ideal", "obstacles"])
def test_pressing_gives_the_felt_stiffness(name: str) -> None:
    """A constraint alone, and with a contact. n' x is n' X F, F the hand's; a run that does not
    swing is taken off, since the handle still settles along a wall, which has a part at any
    frequency."""
    found = recorded(name)
    pose = {pose.name: pose for pose in poses(found)}[found["felt_at"]]
    X = np.array(found["compliance"]) @ [1.0, 1j]
    still = pressed(name, pose, np.ones(3), found["frequency"], 0.0)
    for n in map(np.array, found["along"].values()):
        x, F = pressed(name, pose, n, found["frequency"], 1e-4) - still
        assert n @ x == pytest.approx(n @ X @ F, rel=0.03)


@pytest.mark.parametrize("name", ["closed-loop-ideal", "telescope"])
def test_runs_settle_within_the_margin_and_not_beyond(name: str) -> None:
    """Where constraints limit the gains, and where contacts do. From 0.1 mm off rest: with all
    gains at 0.9 of the margin the handle comes to rest in every pose, in a firm grip, at 1.1 of it
    in one it does not."""
    found = recorded(name)

    def late(pose: Pose, share: float) -> float:
        off = (pose.point[0] + 1e-4, *pose.point[1:])
        options = [
            *gains(found, found["margins"]["tuned"] * share),
            *write_options(pose.started | pose.held | {"hand": spring(off, pose.press, FIRM)}),
            "duration=1.5",
            *NO_ENCODER,
        ]
        run = hl.run(RECORDED / name / "tuned.toml", options, figures=False)
        speed = np.abs(run["haptic_device.v_true"])
        return np.inf if run.fault else float(speed[-256:].max() / speed.max())

    assert max(late(pose, 0.9) for pose in poses(found)) < 0.2
    assert any(late(pose, 1.1) > 0.5 for pose in poses(found))


def test_rest_is_found_with_gains_that_are_unstable_there() -> None:
    """Own gains of `obstacles` throw the handle off; they are judged at the pose all the same."""
    pose = {pose.name: pose for pose in poses(recorded("obstacles"))}["1.8 s"]
    given = {"sensing": "encoders", "graphics.rate": 32} | pose.started | pose.held
    with resting("obstacles", given) as place:
        assert place.signal("haptic_device.x_true") == pytest.approx(pose.point, abs=1e-6)
        assert place.stable(dict.fromkeys(place.gains.laws, 0.5), FIRM)
        assert not place.stable({}, FIRM)


def test_a_contact_that_is_slid_off_is_pressed_lightly() -> None:
    """With the force of its run on a pin the handle slides along it; a light one holds it there."""
    pose = poses(recorded("obstacles"))[-1]
    size = np.hypot(*pose.press[:2])
    assert size == pytest.approx(LIGHT)
    for force, least, most in ((LIGHT, 0.0, 2e-4), (4.7, 4e-3, np.inf)):
        pressed = replace(pose, press=tuple(F * force / size for F in pose.press))
        options = [*write_options(pressed.started | pressed.held), "duration=4.0", *NO_ENCODER]
        run = hl.run(RECORDED / "obstacles" / "tuned.toml", options, figures=False)
        assert run.fault is None
        assert run["virtual_mechanism.F_env"][-1].any()
        assert least < np.hypot(*(run["haptic_device.x_true"][-1] - pose.point)[:2]) < most


def test_slopes_of_operations_have_the_radius_of_the_whole_map() -> None:
    """A judgement takes the slopes of single operations; the whole map, by differences along all of
    its columns, has the same spectral radius."""
    pose = poses(recorded("closed-loop-ideal"))[0]
    given = {"sensing": "encoders", "graphics.rate": 128} | pose.started | pose.held
    with resting("closed-loop-ideal", given) as place:
        period = place.period(dict.fromkeys(("drift", "topology"), 3.0))
        whole = linearised(place.map, period.point)
        radii = [np.abs(np.linalg.eigvals(at.A)).max() for at in (period.in_map, whole)]
        assert radii[0] == pytest.approx(radii[1], rel=1e-6)


@pytest.mark.parametrize(
    ("scene", "options", "why"),
    [
        ("pendulum", {}, "no gains to tune"),
        ("closed-loop-ideal", {}, "sensing=encoders"),
        (
            "enclosure",
            {"sensing": "encoders", "controller.contact": False},
            "controller.contact=true",
        ),
        (
            "closed-loop-ideal",
            {"sensing": "encoders", "graphics.rate": {"min": 20, "max": 30}},
            "varies",
        ),
    ],
)
def test_what_cannot_be_tuned_is_refused(scene: str, options: dict[str, Any], why: str) -> None:
    with pytest.raises(hl.InputFault, match=why):
        hl.tune(scene, options)


def test_a_margin_is_one_or_more() -> None:
    with pytest.raises(hl.InputFault, match="give 1 or more"):
        hl.tune("closed-loop-ideal", margin=0.5)


def recorded(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RECORDED / name / "tune.json").read_text(encoding="utf-8"))
    return found


def poses(found: dict[str, Any]) -> list[Pose]:
    return [Pose(**pose) for pose in found["poses"]]


def gains(found: dict[str, Any], factor: float) -> tuple[str, ...]:
    """The options of all tuned gains with stiffness by a factor, damping by its root."""
    powers = {"stiffness": factor, "damping": factor**0.5}
    return write_options(
        {
            key: (np.array(value) * powers[key.rpartition(".")[2]]).tolist()
            for key, value in found["gains"].items()
        }
    )
