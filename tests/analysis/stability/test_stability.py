"""The stability of scenes, against closed forms and against runs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability import wall_limits
from hapticlink.analysis.stability.forward_sensitivity import KINK
from hapticlink.analysis.stability.hand_cases import SLIGHT
from hapticlink.analysis.stability.modes import Linearisation, judged_modes, modes, verdict
from hapticlink.analysis.stability.smooth_scene import linearisable
from tests.analysis.stability.own_hand import own_hand
from tests.shared_fixtures import status

T = 1 / 512
HELD: dict[str, Any] = {
    "hand": {
        "type": "spring",
        "stiffness": [300.0, 300.0, 1.0],
        "damping": [5.0, 5.0, 0.01],
        "target": [[0.0, 0.0445, 0.0148, -0.7878]],
    }
}


def test_a_sampled_spring_has_the_eigenvalues_of_its_map() -> None:
    """m = 1, K = 100, T = 0.05: z^2 - (2 - alpha/2) z + 1 + alpha/2 with alpha = K T^2/m."""
    found = own_hand("sampled-spring")
    alpha = 0.25
    z = max(np.roots([1.0, -(2 - alpha / 2), 1 + alpha / 2]), key=lambda root: root.imag)
    (mode,) = found.modes
    assert mode.z == pytest.approx(z, rel=1e-8)
    assert found.growth == pytest.approx(math.log(abs(z)) / 0.05, rel=1e-8)
    assert mode.omega == pytest.approx(np.angle(z) / 0.05, rel=1e-8)
    assert found.verdict == "unstable"
    assert found.participation == pytest.approx(
        {"virtual_mechanism.q[1]": 0.5, "virtual_mechanism.qd[1]": 0.5}, abs=1e-6
    )


@pytest.mark.parametrize(
    ("A", "error", "said"),
    [
        ([[1.0, 0.0], [0.0, 0.5]], 1e-6, "stable"),  # moves freely, and is damped otherwise
        ([[1.05, 0.0], [0.0, 0.5]], 0.1, "marginal"),  # may grow
        ([[1.0, 0.1], [0.0, 1.0]], 1e-6, "marginal"),  # moves freely, and nothing else
        ([[1e138, 0.0], [0.0, 0.5]], 1e139, "unstable"),  # grows by 637 1/s, however exactly
    ],
)
def test_a_mode_that_may_grow_is_counted(A: list[list[float]], error: float, said: str) -> None:
    E = np.diag([error, 0.0])
    first = judged_modes(
        modes(Linearisation(np.zeros(2), np.zeros(2), np.eye(2), np.array(A), E), 1.0)
    )[0]
    assert verdict(abs(first.z), first.uncertainty) == said


def test_a_map_that_is_not_finite_is_refused() -> None:
    """As a search for the largest gains meets them."""
    with pytest.raises(hl.InputFault, match="beyond all numbers within a period"):
        modes(
            Linearisation(np.zeros(1), np.zeros(1), np.eye(1), np.array([[np.inf]]), np.eye(1)), 1.0
        )


def test_a_hanging_and_a_standing_mechanism_move_as_their_linearisations_do() -> None:
    """A uniform rod of 1 m and 1 kg with 0.01 N.m.s/rad, and the N-four-bar above its pivots, which
    is singular there: phi'' = a phi, a = g ((N + 1)/2 + N)/((N + 1)/3 + N)."""
    (hanging,) = own_hand("pendulum").modes
    assert hanging.growth == pytest.approx(-0.01 / (2 / 3), rel=1e-5)
    assert math.hypot(hanging.growth, hanging.omega) == pytest.approx(
        math.sqrt(1.5 * 9.81), rel=1e-6
    )
    standing = own_hand("n-four-bar")
    a = 9.81 * (1.5 + 2) / (1.0 + 2)
    growth = [mode.growth for mode in standing.modes]
    assert growth == pytest.approx([math.sqrt(a), -math.sqrt(a)], rel=1e-5)


@pytest.mark.parametrize(("share", "verdict"), [(0.995, "stable"), (1.005, "unstable")])
def test_semi_implicit_euler_is_stable_up_to_alpha_4_minus_2_beta(
    share: float, verdict: str
) -> None:
    beta = 0.5
    spring = {"stiffness": share * (4 - 2 * beta) / T**2, "damping": beta / T}
    options = {"haptics.rate": 512, "mechanism.integrator": "semi-implicit-euler"}
    options |= {f"linkage.joint.rail.{name}": value for name, value in spring.items()}
    found = own_hand("sampled-spring", options | {"hand.stiffness": [0.0, 0.0, 0.0]})
    assert found.verdict == verdict


@pytest.mark.parametrize(("share", "verdict"), [(0.995, "stable"), (1.005, "unstable")])
def test_baumgarte_is_stable_up_to_its_limit_off_the_closures(share: float, verdict: str) -> None:
    """alpha T < 2 (sqrt(1 + beta^2) - beta) under semi-implicit Euler: the map is perturbed off
    the closures, too, and knows the modes of the stabilisation."""
    alpha = share * 2 * (math.sqrt(2) - 1) / T
    options = {
        "mechanism.integrator": "semi-implicit-euler",
        "mechanism.stabilization": "baumgarte",
        "mechanism.alpha": alpha,
        "mechanism.beta": 1.0,
        "hand.wrench": [0.0, 0.0, 0.0],
    }
    found = own_hand("five-bar", options)
    assert found.verdict == verdict
    assert len(found.neutral) >= 2  # it moves freely


@pytest.mark.parametrize(("start", "at", "pull"), [(0.1, 0.0, 50.0), (1.0, 0.95, 1.0)])
def test_the_equilibrium_at_a_contact_is_that_at_which_a_run_rests(
    start: float, at: float, pull: float
) -> None:
    """A bar that falls on a disc at an angle, where a run settles with the growth and frequency of
    the mode found. Newton's method from its start would step through the disc, to a rest within
    it, or up to where the bar stands."""
    along, below = np.exp(1j * at), np.exp(1j * (at - np.pi / 2))
    center = 0.15 * along + 0.05 * below
    bar = {"name": "bar", "mass": 0.5, "inertia": 1e-3, "center": [0.1, 0.0], "radius": 0.01,
           "capsule": [[0.15, 0.0]]}  # fmt: skip
    scene = hl.scene("pendulum", {
        "duration": 1.0,
        "haptics.rate": 1024,
        "linkage": {
            "gravity": [0.0, -5.0],
            "body": [bar],
            "joint": [{"name": "hinge", "child": "bar"}],
            "operational_point": {"body": "bar", "at": [0.15, 0.0]},
            "start": {"hinge": start},
        },
        "contacts": {
            "disc": [{"center": [center.real, center.imag], "radius": 0.04}],
            "stiffness": 4000.0, "damping": 10.0, "detection": "haptics",
        },
        "hand": {
            "type": "spring", "stiffness": [pull, pull, 0.0], "damping": [0.2, 0.2, 0.0],
            "target": [[0.0, 0.15, -0.01, 0.0]],
        },
    })  # fmt: skip
    found = hl.equilibrium_stability(scene)
    assert isinstance(found, hl.Stability)
    run = hl.run(scene, figures=False)
    q = run["virtual_mechanism.q"][:, 0]
    assert found.poses[0].joints["hinge"] == pytest.approx(q[-1], abs=1e-8)
    near = np.diff(q[600:800])  # q'_{k+1} = a q'_k + b q'_{k-1}
    a, b = np.linalg.lstsq(np.column_stack([near[1:-1], near[:-2]]), near[2:])[0]
    assert found.verdict == "stable"
    z = np.exp((found.worst.growth + 2j * np.pi * found.worst.hertz) / 1024)
    assert z == pytest.approx(max(np.roots([1.0, -a, -b]), key=np.imag), abs=1e-4)


def test_growth_and_frequency_are_those_of_a_run_across_rates() -> None:
    """closed-loop-direct in a hand that is a spring: unstable at 30 Hz, with a period of half a
    second that has more than one turn of its mode."""
    found = own_hand("closed-loop-direct", HELD)
    assert found.period == 0.5
    assert found.verdict == "unstable"
    first = found.modes[0]
    rest = found.point
    start = {f"shoulder{i}": rest[f"virtual_mechanism.q[{k}]"] for i, k in ((1, 1), (2, 3))}
    start |= {f"elbow{i}": rest[f"virtual_mechanism.q[{k}]"] for i, k in ((1, 2), (2, 4))}
    run = hl.run(
        "closed-loop-direct",
        HELD
        | {"linkage.start": start, "duration": 6.0, "linkage.start_velocity": {"shoulder1": 1e-9}},
    )
    x = run["virtual_mechanism.x"]
    moved = (x - x[0])[75::15]  # once in a hyperperiod, since the faster mode prevails
    # x_{k+1} = 2 Re(z) x_k - |z|^2 x_{k-1}, in the coordinate that moves most
    before, now, after = (moved[i : len(moved) - 2 + i, 2] for i in range(3))
    scale = np.abs(after)
    rows = np.stack([now / scale, before / scale], axis=1)
    (twice, minus), *_ = np.linalg.lstsq(rows, after / scale, rcond=None)
    assert math.sqrt(-minus) == pytest.approx(abs(first.z), rel=1e-3)
    assert twice == pytest.approx(2 * first.z.real, rel=1e-2)
    crossings = np.count_nonzero(np.diff(np.sign((x - x[0])[75:, 2])))
    hertz = crossings / 2 / (run.time("virtual_mechanism.x")[-1] - 2.5)
    assert first.omega / (2 * np.pi) == pytest.approx(hertz, abs=0.15)


@pytest.mark.parametrize("method", ["newton", "aitken"])
@pytest.mark.parametrize("interpolation", ["zoh", "foh"])
def test_an_algebraic_loop_has_the_growth_of_its_run(method: str, interpolation: str) -> None:
    """A mass of 1 kg and a spring hand that is a plant, iterated: the loop is differentiated from
    the state that is perturbed, and not from the one that its rollbacks had saved before.
    x_{k+1} = a x_k + b x_{k-1}, the mode that decays last."""
    options: dict[str, Any] = {
        "coupling": "iterated",
        "iteration": {"method": method, "interpolation": interpolation},
        "hand": {"type": "spring", "timing": "continuous", "stiffness": [300.0, 0.0, 0.0],
                 "damping": [0.3, 0.0, 0.0], "target": [[0.0, 0.0, 0.0, 0.0]]},
        "haptics.rate": 60,
    }  # fmt: skip
    found = own_hand("sampled-spring", options)
    x = hl.run("sampled-spring", options | {"duration": 3.0}, figures=False)["virtual_mechanism.q"]
    late = x[len(x) // 2 :, 0]
    a, b = np.linalg.lstsq(np.column_stack([late[1:-1], late[:-2]]), late[2:])[0]
    assert found.modes[0].z == pytest.approx(max(np.roots([1.0, -a, -b]), key=np.imag), abs=1e-6)
    assert found.kinks.max() < KINK


def test_redundant_closures_are_kept_by_perturbations() -> None:
    """A bar that hangs on three equal rods, of which two would do (one equation is redundant):
    phi'' = -g (3 m/2 + M)/(l (m + M)) phi. Nothing dissipates: the radius is 1, though z is not."""
    rods, bar, length, down = 0.5, 2.0, 0.8, -math.pi / 2
    rod = {"mass": rods, "inertia": rods * length**2 / 12, "center": [length / 2, 0.0]}
    on_bar = {"parent": "rod1", "child": "bar", "at_parent": [length, 0.0]}
    linkage = {
        "gravity": [0.0, -9.81],
        "operational_point": {"body": "bar"},
        "start": {"joint1": down, "joint2": down, "joint3": down, "bar": -down},
        "body": [
            {"name": "bar", "mass": bar, "inertia": 0.1, "center": [0.5, 0.0]},
            *({"name": f"rod{k}"} | rod for k in (1, 2, 3)),
        ],
        "joint": [
            {"name": "bar"} | on_bar,
            *(
                {"name": f"joint{k}", "child": f"rod{k}", "at_parent": [0.5 * k, 0.0]}
                for k in (1, 2, 3)
            ),
        ],
        "loop": [
            {"bodies": ["bar", f"rod{k}"], "at": [[0.5 * (k - 1), 0.0], [length, 0.0]]}
            for k in (2, 3)
        ],
    }
    found = own_hand(hl.scene("pendulum", {"linkage": linkage, "duration": 1.0}))
    (mode,) = found.modes
    omega = math.sqrt(9.81 * (1.5 * rods + bar) / (length * (rods + bar)))
    assert mode.omega == pytest.approx(omega, rel=1e-6)
    assert found.verdict == "marginal"


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        ("sampled-spring", {"hand": {"type": "constant", "wrench": [1.0, 0.0, 0.0]}}),
        ("virtual-wall", {"fmu.wall.start.stiffness": 6000.0}),
    ],
    ids=["push into the free", "unstable"],
)
def test_a_run_that_keeps_moving_has_no_equilibrium(scene: str, options: dict[str, Any]) -> None:
    with pytest.raises(hl.InputFault, match=r"does not come to rest in 60 s: .* at up to"):
        hl.equilibrium_stability(scene, options)


@pytest.mark.parametrize("late", [3, 4, 12])
def test_many_samples_are_on_their_way(late: int) -> None:
    """A wall whose force comes `late` periods later, against the roots of its equation."""
    gains = np.array([300.0])
    expected = wall_limits.radius(0.3, 5.0, 1 / 512, late, gains, 0 * gains)[0]
    options = {
        "hand.wrench": [0.0, 0.0, 0.0],
        "fmu.wall.settings": {"stiffness": 300.0, "unilateral": False},
        "delays": {"wall.F": late / 512},
    }
    assert own_hand("virtual-wall", options).radius == pytest.approx(expected, abs=1e-8)


def test_samples_of_a_position_gather_while_a_slower_wall_does_not_read_them() -> None:
    """A wall at 64 Hz reads the position of 3 periods of 512 Hz before; m v' = F - b v, exact:
    s_{k+1} = M(8) s_k + G(8) F_k,   F_{k+1} = -K [1 0] (M(5) s_k + G(5) F_k)"""
    m, b, K = 0.3, 5.0, 60.0

    def over(periods: int) -> np.ndarray:
        decay, t = math.exp(-b / m * periods / 512), periods / 512
        moved = (1 - decay) * m / b
        return np.array([[1, moved, (t - moved) / b], [0, decay, (1 - decay) / b]])

    A = np.vstack([over(8), -K * over(5)[0]])
    options = {
        "hand.wrench": [0.0, 0.0, 0.0],
        "fmu.wall.rate": 64,
        "fmu.wall.settings": {"stiffness": K, "unilateral": False},
        "delays": {"virtual_mechanism.rail.position": 0.005},
    }
    found = own_hand("virtual-wall", options)
    first = max(np.linalg.eigvals(A), key=lambda z: (abs(z), z.imag))
    assert found.radius == pytest.approx(abs(first), rel=1e-6)
    assert found.modes[0].omega == pytest.approx(np.angle(first) * 64, rel=1e-6)


def test_what_has_no_map_is_refused() -> None:
    rates = {"graphics.rate": [0.03, 0.07, 0.1, 0.2], "duration": 0.1}
    with pytest.raises(hl.InputFault, match=r"the period of \w+ varies"):
        own_hand("closed-loop-direct", HELD | rates)
    with pytest.raises(hl.InputFault, match="latency and loss are random"):
        own_hand("virtual-wall", {"delays": {"wall.F": {"min": 0.001, "loss": 0.5}}})


@pytest.fixture(scope="module")
def wall_radius() -> float:
    """The spectral radius of `virtual-wall` as it is shipped."""
    return own_hand("virtual-wall").radius


@pytest.mark.parametrize("options", [{"packaging": "native"}, {"isolate": True}, {"fmi": 3}])
def test_every_kind_of_fmu_has_the_same_map(
    tmp_path: Path, options: dict[str, Any], wall_radius: float
) -> None:
    if fmi := options.get("fmi"):
        made = hl.build("virtual-wall", {"packaging": "native"}, out=tmp_path, fmi=fmi)
        mechanism = {"replaces": "virtual_mechanism", "path": str(made["virtual_mechanism"])}
        options = {"fmu.+": mechanism}
    found = own_hand("virtual-wall", options)
    assert found.radius == pytest.approx(wall_radius, rel=1e-9)


@pytest.mark.parametrize(
    ("hold", "weights"),
    [
        ("foh", (1.5, -0.5)),
        ("lead", (1.5, -0.5)),
        ("second-order", (15 / 8, -10 / 8, 3 / 8)),
        ("mean", (0.5, 0.5)),
    ],
)
def test_the_memory_of_a_hold_is_part_of_the_state(hold: str, weights: tuple[float, ...]) -> None:
    """The mass takes the mean over its step of the force that is extrapolated from samples; `zoh`,
    whose memory is none, is that of test_a_sampled_spring_has_the_eigenvalues_of_its_map."""
    found = own_hand("sampled-spring", {"holds": {"hand.F": hold}})
    h, A = 0.05, np.eye(4, k=-1)  # of x_k, x_{k-1}, x_{k-2} and, in the last row, v
    A[0] = A[3] = 0.0
    A[0, 0], A[0, 3], A[3, 3] = 1.0, h, 1.0
    for i, weight in enumerate(weights):
        A[0, i] -= 100.0 * weight * h**2 / 2
        A[3, i] -= 100.0 * weight * h
    assert found.radius == pytest.approx(np.abs(np.linalg.eigvals(A)).max(), rel=1e-8)


def test_friction_and_quanta_are_taken_out_and_named(wall_radius: float) -> None:
    rough = {"fmu.wall.settings.quantum": 1e-4, "linkage.joint.rail.friction": 0.1}
    radius = own_hand("virtual-wall", rough).radius
    assert radius == pytest.approx(wall_radius, rel=1e-8)
    with linearisable("virtual-wall", rough) as (_, _, removed):
        text = "\n".join(removed)
    assert "virtual_mechanism.rail.friction: Coulomb friction, taken out" in text
    assert "wall.quantum: quantisation of the encoder, taken out" in text


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], wall_radius: float) -> None:
    """The wall in the hand of the scene, and the closed form of its port: K T/2."""
    assert status("stability", "virtual-wall", "--equilibrium", "--port", "--out", tmp_path) == 0
    out = capsys.readouterr().out
    assert out.startswith("virtual-wall: stable in the scene's own hand and 1 pose")
    record = json.loads((tmp_path / "stability.json").read_text())
    assert record["verdict"] == "stable"
    assert record["growth_rate"] == pytest.approx(math.log(wall_radius) * 512, rel=1e-6)
    assert record["worst"]["participation"].keys() == {
        "virtual_mechanism.q[1]", "virtual_mechanism.qd[1]"
    }  # fmt: skip
    assert record["port"]["damping_needed"] == pytest.approx(3000 / 512 / 2, rel=1e-3)


@pytest.fixture(scope="module")
def held_by_spring() -> tuple[dict[str, Any], float]:
    """A spring hand that holds `closed-loop-direct`, and its spectral radius with zoh."""
    options = HELD | {"graphics.rate": 64}
    return options, own_hand("closed-loop-direct", options).radius


@pytest.mark.parametrize("pspm", [False, True])
def test_the_hold_passive_is_judged_without_its_friction(
    pspm: bool, held_by_spring: tuple[dict[str, Any], float]
) -> None:
    """As zoh; the recovery of its friction after a step back is no motion that grows."""
    options, plain = held_by_spring
    held: dict[str, Any] = {"hold": "passive"}
    if pspm:
        poses = ("virtual_mechanism.x -> controller.x_S", "virtual_mechanism.v -> controller.v_S")
        held["holds"] = dict.fromkeys(poses, "pspm")
    found = own_hand("closed-loop-direct", options | held)
    assert found.growth < SLIGHT  # with pspm marginal, in the regime of its start
    with linearisable("closed-loop-direct", options | held) as (_, _, removed):
        assert any("the friction of hold passive, taken out" in line for line in removed)
    if not pspm:
        assert found.radius == pytest.approx(plain, abs=1e-6)
    run = hl.run("closed-loop-direct", options | held | {"duration": 5.0}, figures=False)
    speed = np.abs(run["virtual_mechanism.qd"]).max(axis=1)
    assert speed[-64:].max() < 0.1 * speed.max()
