"""Measures of a haptic run for the page.

What is measured is not what has produced it: closures by Appendix A and not by the mechanism's own
h, F_T against the mechanism's P_c of the instant and not the held one that has made it, two plants
against each other and not a law against its own terms. With the local model the mechanism counts
its directions by the matrices of the frames (`Count.held`): there the two are not compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings import block_costs
from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.orchestrator.system.timeline import timeline
from studies.report import appendix_a


def held(results: Results, signal: str) -> Vector:
    """A graphics-rate signal at the haptic samples by a zero-order hold, (rows, ...)."""
    times = results.graphics["time"]
    frame = np.searchsorted(times, results.haptics["time"] + 1e-12, side="right") - 1
    return np.asarray(results.graphics[signal][frame])


def rms(values: Vector) -> Vector:
    """Root mean square over the rows."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


@dataclass(frozen=True)
class Neglected:
    """Terms that (B.7) calls negligible, against those that it keeps: RMS of a_bias and of
    Lambda^-1 (F_h + F_drift), translation (m/s2) and rotation (rad/s2); F_drift, RMS and largest,
    and F_h (N)."""

    bias: tuple[float, float]
    rendered: tuple[float, float]
    drift_force: float
    largest_drift: float
    hand_force: float


def neglected(results: Results) -> Neglected:
    """The neglected terms of a run of the scene closed-loop-ideal."""
    haptics = results.haptics
    bias = haptics["virtual_mechanism.a_bias"]
    wrench = haptics["hand.F"]
    drift = haptics["controller.F_drift"]
    mobility = held(results, "virtual_environment.Lambda_inv")
    rendered = np.einsum("kij,kj->ki", mobility, wrench + drift)

    def parts(a: Vector) -> tuple[float, float]:
        return float(np.hypot(*rms(a[:, :2]))), float(rms(a[:, 2]))

    return Neglected(
        parts(bias),
        parts(rendered),
        float(rms(np.hypot(drift[:, 0], drift[:, 1]))),
        float(np.hypot(drift[:, 0], drift[:, 1]).max()),
        float(np.hypot(*wrench[0, :2])),
    )


def episodes(time: Vector, count: Vector) -> list[tuple[float, float]]:
    """Begin and end (s) of each interval with two or more constrained directions."""
    two = np.r_[False, count >= 2, False]
    edges = np.flatnonzero(np.diff(two.astype(int)))
    last = len(time) - 1
    return [(time[a], time[min(b, last)]) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@dataclass(frozen=True)
class Count:
    """The number of constrained directions in the graphics frames against the mechanism's own:
    frames, frames with another number, intervals with two directions, and those of them that no
    frame shows."""

    frames: int
    wrong: int
    episodes: tuple[tuple[float, float], ...]
    unseen: int
    fold: float  # rad, largest angle between links 3 and 4 with two constrained directions
    held: bool  # whether the mechanism counts by the frames' own matrices (local model)

    @property
    def listed(self) -> str:
        """The intervals (s)."""
        return ", ".join(f"{a:.3f}-{b:.3f}" for a, b in self.episodes)

    @property
    def described(self) -> str:
        """The episodes, and how many the frames miss."""
        if not self.episodes:
            return "never two constraints"
        if self.held:
            return (
                f"two constraints in {len(self.episodes)} episodes ({self.listed} s), by the "
                "matrices of the frames"
            )
        missed = f", of which {self.unseen} fall between the frames" if self.unseen else ""
        return f"two constraints in {len(self.episodes)} episodes ({self.listed} s){missed}"


def count(results: Results) -> Count:
    """Compares the graphics frames of a run with its mechanism."""
    haptics, graphics = results.haptics, results.graphics
    own = haptics["virtual_mechanism.n_constraints"]
    seen = graphics["virtual_environment.n_constraints"]
    at = np.searchsorted(haptics["time"], graphics["time"] - 1e-12)
    wrong = int(np.sum(own[np.minimum(at, len(own) - 1)] != seen))
    times = graphics["time"][seen >= 2]
    found = episodes(haptics["time"], own)
    unseen = sum(not np.any((times >= a) & (times <= b)) for a, b in found)
    fold = folding(haptics["virtual_mechanism.q"][:, 3])[own >= 2]
    held = bool(results.record.scene["local_model"])
    return Count(len(seen), wrong, tuple(found), unseen, float(fold.max(initial=0.0)), held)


class ByCount(NamedTuple):
    """While the mechanism has one constrained direction, and while it has two: median distance
    |x_S - x_D| (mm), RMS of |F_T| (N; NaN without) and of |lambda| (N)."""

    distance: tuple[float, float]
    wrench: tuple[float, float]
    multipliers: tuple[float, float]


def by_count(results: Results) -> ByCount:
    """Distances, topology forces and multipliers by the number of constrained directions."""
    haptics = results.haptics
    two = haptics["virtual_mechanism.n_constraints"] >= 2
    gap = tracking(results)[1]
    multipliers = np.linalg.norm(haptics["virtual_mechanism.lambda"], axis=1)
    named = "controller.F_constraint"
    wrench = haptics[named] if named in haptics else np.full((len(gap), 3), np.nan)
    force = np.hypot(wrench[:, 0], wrench[:, 1])

    def both(of: Callable[[Vector], Vector], values: Vector) -> tuple[float, float]:
        one, more = (float(of(values[m])) if m.any() else np.nan for m in (~two, two))
        return one, more

    return ByCount(both(np.median, gap), both(rms, force), both(rms, multipliers))


def operations(scene: str, *options: str) -> float:
    """Operations of the blocks' graphs in a haptic tick."""
    read = open_scene.load(scene, options)
    return sum(each.operations for each in block_costs.costs(read, timeline(read)))


def folding(q4: Vector) -> Vector:
    """Angle (rad) between links 3 and 4, 0 where they are collinear."""
    return np.asarray(np.abs(np.arctan2(np.sin(2 * q4), np.cos(2 * q4))) / 2)


def closure_gap(results: Results) -> Vector:
    """By how much the loop of the five-bar of Table 6.1 is open (m), from the recorded joint angles
    by the constraint equations of Appendix A, which the mechanism does not use."""
    return np.asarray(
        np.linalg.norm(appendix_a.h(results.haptics["virtual_mechanism.q"].T), axis=0)
    )


def acceleration_error(results: Results) -> float:
    """Relative difference of the velocities that device and mechanism, two plants that start at
    rest under the same hand, have after the first haptic period."""
    haptics = results.haptics
    device, mechanism = (
        haptics[name][1] for name in ("haptic_device.v_true", "virtual_mechanism.v")
    )
    return float(np.abs(device - mechanism).max() / np.abs(mechanism).max())


def resisted_acceleration(results: Results, length_scale: float) -> tuple[float, float]:
    """RMS of the mechanism's acceleration a_bias + Lambda^-1 (F_h - F_drift) along the direction
    that it resists always, and of the whole (m/s2, rotation times the length scale)."""
    haptics, scale = results.haptics, np.array((1, 1, length_scale))
    mobility = haptics["virtual_mechanism.Lambda_inv"] * np.outer(scale, scale)
    wrench = (haptics["hand.F"] - haptics["controller.F_drift"]) / scale
    whole = haptics["virtual_mechanism.a_bias"] * scale
    whole = whole + np.einsum("kij,kj->ki", mobility, wrench)
    along = np.einsum("ki,ki->k", np.linalg.eigh(mobility)[1][:, :, 0], whole)
    return float(rms(along)), float(rms(np.linalg.norm(whole, axis=1)))


def free_work(results: Results, length_scale: float) -> tuple[float, float]:
    """Share of F_T that acts on what is free, |(1 - P_c) S^-1 F_T| / |S^-1 F_T|, with the P_c of
    the mechanism at that instant (F_T was made with that of the graphics frames): the median and
    the 90th percentile over the ticks with a topology force."""
    scaled = results.haptics["controller.F_constraint"] / (1, 1, length_scale)
    P = results.haptics["virtual_mechanism.P_c"]
    free = np.linalg.norm(scaled - np.einsum("kij,kj->ki", P, scaled), axis=1)
    whole = np.linalg.norm(scaled, axis=1)
    shares = (free / np.where(whole > 0, whole, 1.0))[whole > 1e-3 * whole.max()]
    return float(np.median(shares)), float(np.quantile(shares, 0.9))
