"""Attacks the stability theorem of the hold `model` (docs/model-hold.md):

    python -m studies.model_theorem

CASES random cases with all premises, and as many with each of them dropped: couplings of one to six
dimensions with full matrices, and FRAMES frames of random lengths. Writes
results/model/theorem.csv, and the orders of error of the rules to results/model/orders.csv.

The motion of a frame is exact: the mechanism and the handle with its continuous coupling are one
linear system under constant F (matrix exponential), so that the end of the frame is affine in F,
and the rule that makes F of it is a linear equation.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.random import Generator
from scipy.linalg import expm

from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.blas_threads import one_blas_thread

SEED, CASES, FRAMES, LENGTHS = 44, 1000, 60, 5
ROUNDING = 1e-9
"""Growth of W over a frame, relative to the sizes of what it is the sum of, that is none."""
REST = 1e-20
"""W relative to that of the start, below which it is that of velocities (1e-10) of rounding."""
LARGE = 1e3
"""Growth of the motion over all frames, in the root of W, from which on it is called unbounded."""


@dataclass(frozen=True)
class Frame:
    """A frame of length H (s): the inertias of mechanism and handle, the coupling's stiffness and
    damping, and the premises that can be dropped."""

    H: float
    mechanism: Matrix
    handle: Matrix
    K: Matrix
    B: Matrix
    hand: Matrix
    """Stiffness of a hand, whose force is sampled for the mechanism; 0: F_h is constant."""
    ramp: Vector
    """Rate (N/s) of F_h, which the mechanism has as of the frame's start."""
    rule: str = "mid"
    """How F is made of both ends: `mid`, or `last`, `explicit`, `late`."""
    told: float = 0.0
    """The length (s) of the frame that the rule knows; 0: H."""
    ticks: int = 0
    """The coupling's force on the handle is held over H/ticks; 0: continuous."""
    seen: str = "exact"
    """The mechanism's motion within the frame as the handle has it; `held` as at the start."""

    def step(self) -> tuple[Matrix, Matrix]:
        """The matrices that take (s, late, 1) to the state s = (e, e', x, v) after the frame, x and
        v of the handle, and to the F of the rule; late is that of the frame before."""
        n, H = len(self.K), self.told or self.H
        P, Q, p = self.motion(H)
        one, none = np.eye(n), np.zeros((n, n))
        e, de = (np.hstack([one if k == block else none for k in range(4)]) for block in (0, 1))
        if self.rule == "last":
            F, constant = self.K @ e + self.B @ de, np.zeros(n)
        elif self.rule == "explicit":
            F, constant = self.K @ (e + H / 2 * de) + self.B @ de, np.zeros(n)
        else:
            half, rate = self.K / 2, self.B / H
            solve = np.linalg.inv(one - (half + rate) @ Q[:n])
            F = solve @ (half @ (e + P[:n]) + rate @ (P[:n] - e))
            constant = solve @ (half + rate) @ p[:n]
        made = np.hstack([F, none, constant[:, None]])
        applied = made
        if self.rule == "late":
            applied = np.hstack([np.zeros((n, 4 * n)), one, np.zeros((n, 1))])
        if self.told:
            P, Q, p = self.motion(self.H)
        return np.hstack([P, np.zeros((4 * n, n)), p[:, None]]) + Q @ applied, made

    def motion(self, H: float) -> tuple[Matrix, Matrix, Vector]:
        """After H the state is P s + Q F + p."""
        n = len(self.K)
        S, D = np.linalg.inv(self.mechanism), np.linalg.inv(self.handle)
        one = np.eye(n)
        # and what is constant: F, the hand's force on the mechanism and how much more the handle
        # gets of it (at a rate), x_S and v_S as seen, the coupling's force where it is held
        e, de, x, v, F, G, g, rate, xs, vs, f = range(11)
        A = np.zeros((11, 11, n, n))
        A[e, de] = A[x, v] = A[g, rate] = one
        coupling = {e: self.K, de: self.B}
        if self.seen == "held":
            coupling = {xs: self.K, x: -self.K, vs: self.B, v: -self.B}
        if self.ticks:
            coupling = {f: one}
        for place, of in [*coupling.items(), (g, one), (x, -self.hand)]:
            A[v, place] += D @ of
            A[de, place] -= D @ of
        A[de, F], A[de, G] = -S, S
        start = np.zeros((11, 6, n, n))
        for place, block in ((e, 0), (de, 1), (x, 2), (v, 3), (F, 4), (rate, 5)):
            start[place, block] = one
        start[G, 2] = -self.hand
        start[xs, 0] = start[xs, 2] = start[vs, 1] = start[vs, 3] = one
        generator = A.transpose(0, 2, 1, 3).reshape(11 * n, 11 * n)
        X = start.transpose(0, 2, 1, 3).reshape(11 * n, 6 * n)
        over = expm(generator * (H / (self.ticks or 1)))
        for _ in range(self.ticks or 1):
            if self.ticks:
                X[f * n :] = self.K @ X[:n] + self.B @ X[n : 2 * n]
            X = over @ X
        X = X[: 4 * n]
        return X[:, : 4 * n], X[:, 4 * n : 5 * n], X[:, 5 * n :] @ self.ramp

    def energy(self, s: Vector) -> tuple[float, float]:
        """W = e'^T Lambda e'/2 + e^T K e, and the size of what it is the sum of."""
        n = len(self.K)
        e, de = s[:n], s[n : 2 * n]
        moving = de @ self.mechanism @ de / 2
        size = moving + np.linalg.norm(self.K, 2) * (e @ e)
        return float(moving + e @ self.K @ e), float(size)


def positive(draw: Generator, n: int, low: float, high: float, rank: int | None = None) -> Matrix:
    """A full symmetric matrix with eigenvalues between 10^low and 10^high, all but `rank` 0."""
    Q, _ = np.linalg.qr(draw.normal(size=(n, n)))
    values = 10.0 ** draw.uniform(low, high, n)
    values[n if rank is None else rank :] = 0.0
    made: Matrix = Q @ np.diag(values) @ Q.T
    return (made + made.T) / 2


def skew(draw: Generator, like: Matrix) -> Matrix:
    """A skew matrix of the size of another."""
    A = draw.normal(size=like.shape)
    A = A - A.T
    made: Matrix = A * (np.linalg.norm(like, 2) / float(np.linalg.norm(A, 2)))
    return made


def draw_frames(draw: Generator, least: int = 1) -> list[Frame]:
    """Frames of LENGTHS lengths of a case with all premises; K and B may be singular."""
    n = int(draw.integers(least, 7))
    ranks = [int(draw.integers(0, n + 1)) if draw.random() < 0.3 else None for _ in range(2)]
    inertia = positive(draw, n, -1, 1)
    K, B = positive(draw, n, -4, 4, ranks[0]), positive(draw, n, -4, 3, ranks[1])
    lengths = 10.0 ** draw.uniform(-2, 1, LENGTHS)
    return [Frame(H, inertia, inertia, K, B, np.zeros((n, n)), np.zeros(n)) for H in lengths]


Change = Callable[[Generator, Frame], Frame]


def _indefinite(draw: Generator, A: Matrix) -> Matrix:
    """A with its first eigenvalue turned negative."""
    values, vectors = np.linalg.eigh(A)
    values[-1 if values[-1] > 0 else 0] *= -(10.0 ** draw.uniform(-2, 0))
    made: Matrix = vectors @ np.diag(values) @ vectors.T
    return (made + made.T) / 2


@dataclass(frozen=True)
class Variant:
    """A premise that is dropped: `once` changes all frames of a case alike, `each` every one."""

    name: str
    once: Change | None = None
    each: Change | None = None
    least: int = 1
    """Dimensions from which on it can be dropped."""


VARIANTS = (
    Variant("all premises"),
    Variant(
        "all premises; B has a skew part",
        lambda draw, f: replace(f, B=f.B + skew(draw, f.B)),
        least=2,
    ),
    Variant("K has a skew part", lambda draw, f: replace(f, K=f.K + skew(draw, f.K)), least=2),
    Variant("K has a negative eigenvalue", lambda draw, f: replace(f, K=_indefinite(draw, f.K))),
    Variant("B has a negative eigenvalue", lambda draw, f: replace(f, B=_indefinite(draw, f.B))),
    Variant(
        "the handle has an inertia of its own",
        lambda draw, f: replace(f, handle=positive(draw, len(f.K), -1, 1)),
    ),
    Variant("Lambda changes at frames", None, lambda draw, f: _with_inertia(f, draw)),
    Variant(
        "K and B change at frames",
        None,
        lambda draw, f: replace(
            f, K=positive(draw, len(f.K), -4, 4), B=positive(draw, len(f.K), -4, 3)
        ),
    ),
    Variant(
        "F_h changes within frames",
        None,
        lambda draw, f: replace(f, ramp=draw.normal(size=len(f.K))),
    ),
    Variant(
        "the hand has a stiffness",
        lambda draw, f: replace(f, hand=positive(draw, len(f.K), -4, 4)),
    ),
    Variant(
        "the handle has the mechanism's motion as of the frame's start",
        lambda draw, f: replace(f, seen="held"),
    ),
    Variant(
        "T > 0: 1 to 16 ticks a frame",
        lambda draw, f: replace(f, ticks=int(draw.integers(1, 17))),
    ),
    Variant(
        "e of the frame's end is extrapolated: e + H e'",
        lambda draw, f: replace(f, rule="explicit"),
    ),
    Variant(
        "the frame's length is another one than was told",
        None,
        lambda draw, f: replace(f, told=f.H * 10.0 ** draw.uniform(-0.5, 0.5)),
    ),
    Variant("the mechanism gets F a frame late", lambda draw, f: replace(f, rule="late")),
    Variant("`last` in place of `mid`", lambda draw, f: replace(f, rule="last")),
)


def _with_inertia(f: Frame, draw: Generator) -> Frame:
    inertia = positive(draw, len(f.K), -1, 1)
    return replace(f, mechanism=inertia, handle=inertia)


@dataclass(frozen=True)
class Count:
    """Of a variant's cases: in which W grew from a frame to the next, in which the motion grew
    by more than LARGE, and the largest growth of W relative to the size of its parts."""

    premise: str
    cases: int
    grew: int
    unbounded: int
    largest: float


def attack(variant: Variant, cases: int = CASES, seed: int = SEED) -> Count:
    """The count of a variant; its seed is its own, so that each row can be made alone."""
    draw = np.random.default_rng([seed, VARIANTS.index(variant)])
    grew, unbounded, largest = 0, 0, 0.0
    for _ in range(cases):
        frames = draw_frames(draw, variant.least)
        if variant.once:
            changed = variant.once(draw, frames[0])
            frames = [replace(changed, H=frame.H) for frame in frames]
        if variant.each:
            frames = [variant.each(draw, frame) for frame in frames]
        with np.errstate(all="ignore"):  # a motion that leaves the range of numbers
            growth, times = run(frames, draw)
        grew += growth > ROUNDING
        unbounded += times > LARGE
        largest = max(largest, growth)
    return Count(variant.name, cases, grew, unbounded, largest)


def run(frames: list[Frame], draw: Generator) -> tuple[float, float]:
    """The largest growth of W from a frame to the next, relative to the size of its parts, and that
    of the root of this size over all; from a random state, over the frames in a random order."""
    n = len(frames[0].K)
    z = np.concatenate([draw.normal(size=2 * n), np.zeros(3 * n), [1.0]])
    try:
        steps = [frame.step() for frame in frames]
    except np.linalg.LinAlgError:  # no F keeps to the rule
        return np.inf, np.inf
    order = draw.integers(0, len(frames), FRAMES + 1).tolist()
    before, size = frames[order[0]].energy(z)
    largest, first = 0.0, size
    for k, following in pairwise(order):
        state, made = steps[k]
        z = np.concatenate([state @ z, made @ z, [1.0]])
        after, reached = frames[following].energy(z)
        if not reached < 1e200:
            return largest, np.inf
        of = float(max(size, reached, REST * first))
        largest = max(largest, (after - before) / of)
        before, size = after, reached
    return largest, float(np.sqrt(size / first))


def of_errors() -> Iterator[dict[str, object]]:
    """The rms of e in a force that changes, by rule and frame length, and its order."""
    K, B, w, seconds = 400.0, 40.0, 2 * np.pi * 0.5, 8.0
    for rule, lead in (("last", 0.0), ("mid", 0.0), ("mid", 0.5), ("mid", 1.0)):
        last = np.nan
        for rate in (8, 16, 32, 64, 128):
            error = _rms(rule, lead, 1.0 / rate, K, B, w, seconds)
            yield {
                "rule": rule,
                "lead": lead,
                "rate_hz": rate,
                "rms_mm": f"{1e3 * error:.4g}",
                "order": f"{np.log2(last / error):.2f}" if last == last else "",
                "rms_over_foretold": f"{error / (w / rate / (4 * K) / np.sqrt(2)):.4f}",
            }
            last = error


def _rms(rule: str, lead: float, H: float, K: float, B: float, w: float, seconds: float) -> float:
    """The rms of e (m) at 1 kg in F_h = sin(w t) over its second half, in which it is periodic."""
    one = np.eye(1)
    frame = Frame(H, one, one, K * one, B * one, 0 * one, np.zeros(1), rule=rule)
    P, Q, _ = frame.motion(H)
    A = np.array([[0, 1, 0, 0], [-K, -B, -1, 0], [0, 0, 0, w], [0, 0, -w, 0]])
    forced = expm(A * H)[:2, 2:]  # of F_h(t) on e, with sin(w t), cos(w t) at the frame's start
    s, kept = np.zeros(2), []
    for k in range(round(seconds / H)):
        t = k * H
        mean = (np.cos(w * (t - H)) - np.cos(w * t)) / (w * H)  # of the frame before
        held = np.sin(w * t) + lead * (np.sin(w * t) - mean)
        free = P[:2, :2] @ s + forced @ [np.sin(w * t), np.cos(w * t)] - Q[:2, 0] * held
        # the rule foretells the end with the held F_h on both sides, which is all that it knows
        known = P[:2, :2] @ s
        F = K * s[0] + B * s[1]
        if rule == "mid":
            half, slope = K / 2, B / H
            F = (half * (s[0] + known[0]) + slope * (known[0] - s[0])) / (
                1 - (half + slope) * Q[0, 0]
            )
        s = free + Q[:2, 0] * F
        kept.append(s[0])
    late = np.array(kept[len(kept) // 2 :])
    return float(np.sqrt(np.mean(late**2)))


@one_blas_thread()
def main(folder: Path) -> None:
    """Writes both tables."""
    counts = [attack(variant) for variant in VARIANTS]
    header = ("premise", "cases", "w_grew", "unbounded", "largest_growth")
    rows = [(c.premise, c.cases, c.grew, c.unbounded, f"{max(0.0, c.largest):.1g}") for c in counts]
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / "theorem.csv", header, rows)
    orders = [*of_errors()]
    _write(folder / "orders.csv", tuple(orders[0]), [tuple(row.values()) for row in orders])


def _write(path: Path, header: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])
    print(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else "results/model"))
