"""Limits of stability of a virtual coupling across rates that do not divide, on real FMUs.

A device (m = 0.1, b = 2) at 512 Hz and a linkage (M = 0.5, b_l = 1) at the graphics rate, joined by
a spring F = K (x_l - x) + B (v_l - v), B = 1. The device takes it sampled in the fast block, from
the linkage's held pose and velocity. The linkage takes that force held, or has a spring of its own
inside, continuous, to the held pose and velocity of the device. First crossing of stability in K,
computed independently.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.analysis.stability.equilibrium import equilibrium
from hapticlink.analysis.stability.lifted_map import open_lifted_map
from hapticlink.analysis.stability.modes import modes
from hapticlink.analysis.stability.varying_rate import edges_of
from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build_fmu import build
from hapticlink.orchestrator.base.ticks import Clock, Frames, Timeline
from hapticlink.orchestrator.fmi.description import Description, describe
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.execute_plan import run
from hapticlink.orchestrator.system.system import Coupling, Fmu, System
from tests.orchestrator.systems import connected
from tests.orchestrator.timelines import fixed

X, V, F = Variable("x", (), "m"), Variable("v", (), "m/s"), Variable("F", (), "N")
GAIN = Variable("K", (), "N/m", 100.0)
GROUND = Variable("K_g", (), "N/m", 0.0)
FAST = [
    ("device.x", "spring.x"),
    ("device.v", "spring.v"),
    ("linkage.x", "spring.x_l"),
    ("linkage.v", "spring.v_l"),
    ("spring.F", "device.F"),
]
ROWS = {
    "linkage": [("spring.F_l", "linkage.F")],
    "sprung": [("device.x", "linkage.x_d"), ("device.v", "linkage.v_d")],
}

LIMITS = [
    ("linkage", 20, "tick", 561),
    ("linkage", 60, "tick", 1199),
    ("linkage", 512, "tick", 2487),
    ("sprung", 10, "tick", 181),
    ("sprung", 60, "tick", 1122),
    ("sprung", 60, "exact", 1004),
]
"""Linkage, graphics rate (Hz), alignment of its frames, and the limit (N/m)."""


Fmus = dict[str, Description]


def mass(name: str, m: float, b: float, start: float) -> Component:
    """m v' = F - b v, exact for a constant force."""
    block = Block(inputs=[F], states=[X, V], outputs=[X, V])
    x, v, force, h = block.x["x"], block.x["v"], block.u["F"], block.h
    decay = ca.exp(-b / m * h)
    end = {"v": decay * v + (1 - decay) * force / b}
    end["x"] = x + force / b * h + (v - force / b) * (1 - decay) * m / b
    initial = {"x": ca.SX(0.0), "v": ca.SX(start)}
    output = {"x": x, "v": v}
    return block.component(name, "a mass", "continuous", initial=initial, step=end, output=output)


def spring() -> Component:
    block = Block(
        inputs=[X, V, Variable("x_l", (), "m"), Variable("v_l", (), "m/s")],
        parameters=[GAIN],
        outputs=[F, Variable("F_l", (), "N")],
    )
    u = block.u
    force = block.p["K"] * (u["x_l"] - u["x"]) + (u["v_l"] - u["v"])
    output = {"F": force, "F_l": -force}
    return block.component("spring", "a spring", "sampled", initial={}, step={}, output=output)


def driven(
    x: ca.SX, v: ca.SX, force: ca.SX, k: float | ca.SX, c: float, h: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """x'' = force - k x - c v over h, the force constant; exact for c^2 < 4 k."""
    a, w = c / 2, ca.sqrt(k - c * c / 4)
    e, decay, cos, sin = x - force / k, ca.exp(-a * h), ca.cos(w * h), ca.sin(w * h)
    moved = force / k + decay * (e * cos + (v + a * e) / w * sin)
    return moved, decay * (v * cos - (k * e + a * v) / w * sin)


def sprung() -> Component:
    """The linkage with the spring inside, exact:
    M v' = K (x_d - x) + B (v_d - v) - b_l v - K_g x."""
    block = Block(
        inputs=[Variable("x_d", (), "m"), Variable("v_d", (), "m/s")],
        parameters=[GAIN, GROUND],
        states=[X, V],
        outputs=[X, V],
    )
    u, k, ground = block.u, block.p["K"], block.p["K_g"]
    pull = (k * u["x_d"] + u["v_d"]) / 0.5
    x, v = driven(block.x["x"], block.x["v"], pull, (k + ground) / 0.5, 4.0, block.h)
    initial = {"x": ca.SX(0.0), "v": ca.SX(0.0)}
    step, output = {"x": x, "v": v}, {name: block.x[name] for name in ("x", "v")}
    return block.component(
        "sprung", "a mass on a spring", "continuous", initial=initial, step=step, output=output
    )


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("multirate")
    parts = (mass("device", 0.1, 2.0, 1.0), spring(), mass("linkage", 0.5, 1.0, 0.0), sprung())
    return {c.name: describe(build(c, folder)) for c in parts}


def forces(made: System) -> NDArray[np.float64]:
    """|F| of the sampled spring at every tick."""
    results = RunResults()
    assert run(Plan(made), results).fault is None
    return np.abs(results.tables()["haptics"]["spring.F"])


def system(
    fmus: Fmus, linkage: str, timeline: Timeline, gain: float, ground: float = 0.0
) -> System:
    def unit(name: str, fmu: str, clock: str) -> Fmu:
        values = [(s, gain) for s in fmus[fmu].port("K", "parameter")]
        values += [(s, ground) for s in fmus[fmu].port("K_g", "parameter")]
        return Fmu(name, fmus[fmu], clock, tuple(values))

    units = (
        unit("device", "device", "haptics"),
        unit("spring", "spring", "haptics"),
        unit("linkage", linkage, "graphics"),
    )
    connections = connected(units, [*FAST, *ROWS[linkage]], timeline)[0]
    return System(units, connections, timeline, Coupling("gauss-seidel"))


def radius(made: System) -> float:
    """The spectral radius of the lifted map, over a hyperperiod."""
    with open_lifted_map(made) as map_:
        found = modes(equilibrium(map_, map_.start).linear, map_.period)
    return max(abs(mode.z) for mode in found if not mode.neutral)


@pytest.mark.parametrize(("linkage", "rate", "align", "limit"), LIMITS)
def test_limit_of_the_coupling_in_a_run_and_in_the_lifted_map(fmus, linkage, rate, align, limit):
    """To one percent, and to half a percent."""
    timeline = fixed(Fraction(512), Fraction(rate), 512 * 16, align)

    def made(share):
        return system(fmus, linkage, timeline, share * limit)

    def growth(share):
        """Between the last quarters of a run."""
        _, _, third, last = np.split(forces(made(share))[1:], 4)
        return float(last.max() / third.max())

    assert growth(0.99) < 1 < growth(1.01)
    assert radius(made(0.995)) < 1.0 < radius(made(1.005))


def alternating(fmus: Fmus, frames: tuple[int, int]) -> tuple[System, Sequence[int]]:
    """Frames of the lengths `frames` (ticks) in turn, and their starts. K = 1050 N/m and a spring
    of 20 N/m to ground."""
    starts = Frames(lambda i: i // 2 * sum(frames) + i % 2 * frames[0], 100, 2)
    clocks = (Clock("haptics", range(starts[98])), Clock("graphics", starts))
    # Short of what ends a run as diverged.
    timeline = Timeline(Fraction(1, 512), starts[32], clocks)
    return system(fmus, "sprung", timeline, 1050.0, 20.0), starts


GROWN = 1.86
"""Of the force, from frame to frame."""


@pytest.mark.parametrize("frames", [(17, 17), (51, 51), (17, 51)], ids=str)
def test_alternating_frames_grow_where_each_alone_is_stable(fmus, frames):
    """In the lifted map and in a run: spectral radii at most .986 alone."""
    made, starts = alternating(fmus, frames)
    force = forces(made)
    peaks = [force[a:b].max() for a, b in pairwise(starts[:33])]
    grown = (max(peaks[-10:]) / max(peaks[-30:-20])) ** (1 / 20)
    if frames == (17, 51):
        assert radius(made) ** (1 / 2) == pytest.approx(GROWN, rel=0.005)
        assert grown == pytest.approx(GROWN, rel=0.005)
    else:
        assert radius(made) ** (1 / 2) < 0.9865
        assert grown < 0.99


def test_matrices_of_frames_in_turn_grow_as_the_alternating_ones(fmus):
    """Each length alone is stable; their product grows as the run does."""
    clocks = (Clock("haptics", range(1000)), Clock("graphics", [0, 17, 68, 85, 136]))
    made = system(fmus, "sprung", Timeline(Fraction(1, 512), 900, clocks), 1050.0, 20.0)
    edges = edges_of(None, made, 1, [17, 51])
    alone = [np.abs(np.linalg.eigvals(edge.A)).max() for edge in edges]
    assert max(alone) < 0.9865
    assert len(edges) == 2
    in_turn = np.abs(np.linalg.eigvals(edges[0].A @ edges[1].A)).max() ** 0.5
    assert in_turn == pytest.approx(GROWN, rel=0.005)
