"""The stability theorem of the rule `mid` and its attack, against a derivation of its own.

Here e'' = -Lambda^-1 (F + K e + B e') alone, in 40 digits, with the integral of the loss by the
exponential of Van Loan, IEEE Trans. Automatic Control 23 (1978), 395; the study has both bodies, in
double precision.
"""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from mpmath import mp

from studies.model_theorem import VARIANTS, Frame, Variant, attack, draw_frames, of_errors, positive

DRAWS = 12


def exact(frame: Frame, e: list[float], de: list[float]) -> tuple[mp.mpf, mp.mpf, mp.matrix]:
    """The change of W over a frame with `mid`, what the theorem says of it, and (e, e') after."""
    n, H = len(e), mp.mpf(frame.H)
    L, K, B = (mp.matrix(each.tolist()) for each in (frame.mechanism, frame.K, frame.B))
    inverse = L**-1
    A = mp.zeros(2 * n + n)
    for i in range(n):
        A[i, n + i] = 1
    for block, of in ((0, K), (1, B), (2, mp.eye(n))):
        A[n : 2 * n, block * n : (block + 1) * n] = -inverse * of
    over = mp.expm(A * H)
    before = mp.matrix([*e, *de])
    P, Q = over[: 2 * n, : 2 * n], over[: 2 * n, 2 * n :]
    E = before[:n]
    gain = K / 2 + B / H
    F = mp.lu_solve(mp.eye(n) - gain * Q[:n, :], K * E / 2 - B * E / H + gain * P[:n, :] * before)
    after = P * before + Q * F

    def W(s: mp.matrix) -> mp.mpf:
        return (s[n:].T * L * s[n:])[0] / 2 + (s[:n].T * K * s[:n])[0]

    loss = mp.zeros(3 * n)
    loss[n : 2 * n, n : 2 * n] = B
    vanloan = mp.zeros(6 * n)
    vanloan[: 3 * n, : 3 * n], vanloan[: 3 * n, 3 * n :] = -A.T, loss
    vanloan[3 * n :, 3 * n :] = A
    made = mp.expm(vanloan * H)
    integral = made[3 * n :, 3 * n :].T * made[: 3 * n, 3 * n :]
    start = mp.matrix([*before, *F])
    step = after[:n] - E
    said = -(start.T * integral * start)[0] - (step.T * B * step)[0] / H
    return W(after) - W(before), said, after


def draw_one(draw: np.random.Generator, n: int = 2) -> Frame:
    """A frame with all premises, whose exponentials stay within 40 digits."""
    inertia, K, B = (positive(draw, n, -1, high) for high in (1, 2, 1))
    return Frame(10 ** draw.uniform(-1, 0.3), inertia, inertia, K, B, 0 * K, np.zeros(n))


@pytest.mark.parametrize("seed", range(DRAWS))
def test_w_changes_by_what_is_lost(seed: int) -> None:
    draw = np.random.default_rng([1, seed])
    frame, e, de = draw_one(draw), draw.normal(size=2), draw.normal(size=2)
    with mpmath.workdps(60):
        change, said, after = exact(frame, e.tolist(), de.tolist())
        assert abs(change - said) < mp.mpf(10) ** -25 * (1 + abs(change))
        assert said < 0
    state, _ = frame.step()
    own = state @ np.concatenate([e, de, draw.normal(size=6), [1.0]])
    assert own[:4] == pytest.approx([float(x) for x in after], rel=1e-8, abs=1e-10)


def norm_in_w(frame: Frame) -> float:
    """The largest growth of the root of W over a frame, of all states."""
    n = len(frame.K)
    M = frame.step()[0][: 2 * n, : 2 * n]
    metric = np.zeros((2 * n, 2 * n))
    metric[:n, :n], metric[n:, n:] = frame.K, frame.mechanism / 2
    root = np.linalg.cholesky(metric).T
    return float(np.linalg.norm(root @ M @ np.linalg.inv(root), 2))


def test_no_state_makes_w_grow() -> None:
    draw = np.random.default_rng(2)
    for _ in range(40):
        frames = draw_frames(draw)
        n = len(frames[0].K)
        gains = {"K": positive(draw, n, -2, 2), "B": positive(draw, n, -2, 2)}
        for frame in frames:
            assert norm_in_w(replace(frame, **gains)) < 1.0


def test_a_frame_that_never_ends_leaves_a_third() -> None:
    """e_(n+1) = -e_n/3: the handle comes to rest where K e = -F, and F = K (e_n + e_(n+1))/2."""
    frame = replace(draw_one(np.random.default_rng(3)), H=1e7)
    state, _ = frame.step()
    assert state[:4, :2] == pytest.approx(np.vstack([-np.eye(2) / 3, np.zeros((2, 2))]), abs=1e-5)


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_what_falls_without_a_premise(variant: Variant) -> None:
    found = attack(variant, cases=25)
    falls = "all premises" not in found.premise
    if "K has a negative" in found.premise:  # W is as the theorem says, but bounds nothing
        assert found.unbounded
        return
    assert (found.grew > 0) == falls
    assert falls or not found.unbounded


def test_orders_of_error() -> None:
    """`last` and `mid` leave H F_h'/(4 K), a lead of 1/2 half of it, one of 1 has order 2."""
    rows = {(r["rule"], r["lead"], r["rate_hz"]): r for r in of_errors()}

    def beside(*key: object) -> float:
        return float(rows[*key, 128]["rms_over_foretold"])

    assert beside("last", 0.0) == pytest.approx(1.0, abs=0.1)
    assert beside("mid", 0.0) == pytest.approx(1.0, abs=0.1)
    assert beside("mid", 0.5) == pytest.approx(0.5, abs=0.05)
    assert float(rows["mid", 1.0, 128]["order"]) > 1.8
    for k, lead in ((1, 0.0), (1, 0.5)):
        assert float(rows["mid", lead, 128]["order"]) == pytest.approx(k, abs=0.15)


@pytest.mark.parametrize("H", [0.1, 0.05])
def test_errors_of_motion_within_a_frame(H: float) -> None:
    """Of x = sin 3t, and of a matrix that turns: j H^3/6 of `const`, H^4 |x''''|/384 of the cubic
    through both ends, H^2 |M''|/8 of the line, each at its largest derivative."""
    s, w, t = np.linspace(0.0, H, 401), 3.0, np.linspace(0.0, 2 * np.pi / 3.0, 241)[:, None]
    x, v, a = np.sin(w * (t + s)), w * np.cos(w * t), -w * w * np.sin(w * t)
    const = np.sin(w * t) + v * s + a * s**2 / 2
    assert np.abs(const - x).max() == pytest.approx(w**3 * H**3 / 6, rel=0.05)
    r, after = s / H, (np.sin(w * (t + H)), w * np.cos(w * (t + H)))
    cubic = (
        (2 * r**3 - 3 * r**2 + 1) * np.sin(w * t)
        + (r**3 - 2 * r**2 + r) * H * v
        + (3 * r**2 - 2 * r**3) * after[0]
        + (r**3 - r**2) * H * after[1]
    )
    assert np.abs(cubic - x).max() == pytest.approx(w**4 * H**4 / 384, rel=0.05)
    line = (1 - r) * np.sin(w * t) + r * after[0]
    assert np.abs(line - x).max() == pytest.approx(w**2 * H**2 / 8, rel=0.05)
