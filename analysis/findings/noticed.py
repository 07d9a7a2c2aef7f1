"""What a hand would notice of a run, by what people can tell (docs/transparency.md).

**Tracking error.** With the impedance law the handle accelerates as the mechanism does under
F_h + E, where E = S (I - P_c) S^-1 F_drift is the virtual coupling in the free directions, while
the hand feels F_h. Both are averaged over a period of VIBRATION. The error is noticed where

    | |F_h| - |F_h + E| | > FORCE max(|F_h + E|, WEAKEST)        or, with |E| > FORCE WEAKEST,
    angle(F_h, F_h + E) > DIRECTION

**Shaking.** The amplitude sqrt(2 int S_a df) from VIBRATION to half the haptic rate, S_a the
spectrum of the handle's acceleration within WINDOW, where that is largest. Motors and hands hold
their forces over a period, so that at w the acceleration has sin(w T/2)/(w T/2) of what the steps
(v_{k+1} - v_k)/T have. From 40 Hz to where skin is most sensitive thresholds of displacement fall
by 12 dB an octave, which is a constant acceleration.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import reduce
from itertools import combinations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hapticlink.analysis.findings.tracking import (
    UserSignals,
    find_users,
    newest,
    of_block,
    of_port,
    space_of,
)
from hapticlink.components.port_space import PortSpace
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.signal_names import HANDLE_VELOCITY, PROJECTORS, signal_of_user
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.orchestrator.results.recorded_scene import scene_part
from hapticlink.orchestrator.results.run_record import Noticed, NoticedError, Shaking

FORCE = 0.1
"""Differential threshold of a force, 5 to 10 % from 2.5 to 10 N: Pang, Tan, Durlach, Perception &
Psychophysics 49 (1991), 531."""
WEAKEST = 2.5
"""The least force (N) of these; the threshold of a weaker one is taken for that of this one."""
DIRECTION = 25.6
"""That of the direction of a force (degrees), by touch alone: Barbagli, Salisbury, Ho, Spence, Tan,
ACM Trans. Applied Perception 3 (2006), 125."""
VIBRATION = 40.0
"""Frequency (Hz) from which on skin and hand feel no motion but vibration: Talbot, Darian-Smith,
Kornhuber, Mountcastle, J. Neurophysiology 31 (1968), 301."""
SHAKING = 0.25
"""Amplitude (m/s2) of an acceleration that a hand feels: 0.1 um at 250 Hz, Verrillo, J. Acoust.
Soc. Am. 35 (1963), 1962."""
FAINTEST = 0.012
"""The same of the most sensitive hands around a handle: 0.01 um at 175 Hz, Brisben, Hsiao, Johnson,
J. Neurophysiology 81 (1999), 1548. Below 150 Hz their threshold rises by more than 12 dB an
octave."""
WINDOW = 0.25  # s
AT_A_TIME = 64
"""Windows of a run in memory at a time."""
ROUNDING = 1e-9


def noticed(results: Results) -> dict[str, Noticed]:
    """By the names of users with a device; without what is not recorded or not known."""
    found = {}
    for user in find_users(results):
        error, shaken = _of_coupling(results, user), _of_handle(results, user)
        if error or shaken:
            found[user.name] = Noticed(error, shaken)
    return found


def _of_coupling(results: Results, user: UserSignals) -> NoticedError | None:
    """`tracking_noticed` of a user; None without an impedance law of this package."""
    table, scene = of_port(results, user.drift), results.record.scene
    law = (scene["controllers"] or {}).get(user.name) or scene["controller"] or {}
    known = law.get("impedance") and user.controller not in results.record.replaced
    if table is None or not known or user.hand not in table or len(table["time"]) < 2:
        return None
    signals = (signal_of_user(signal, user.name) for signal in PROJECTORS)
    space = space_of(results)
    shape = space.projector.shape
    projector = next((s for s in signals if of_block(results, s, *shape)), "")
    held = of_block(results, projector, *shape) if projector else None
    S = _scaling(results, space) if held else None

    def of_rows(time: Vector, hand: Vector, drift: Vector) -> Vector:
        if held and S is not None:
            P = held[projector][newest(held, time)]
            drift = drift - S * np.einsum("kij,kj->ki", P, drift / S)
        return np.concatenate([hand.T[: space.lengths], drift.T[: space.lengths]])

    felt = table.by_row(of_rows, "time", user.hand, user.drift)
    return tracking_noticed(table["time"], *np.split(felt, 2))


def _scaling(results: Results, space: PortSpace) -> Vector:
    """The diagonal of S."""
    from hapticlink.components.linkage.parameters import mean_link_length  # casadi

    length = results.record.scene["directions"]["length_scale"]
    length = length or mean_link_length(scene_part(results, "linkage", Linkage))
    return np.array(space.scaling(length), float)


def tracking_noticed(time: Vector, hand: Vector, error: Vector) -> NoticedError | None:
    """What is noticed of the error E of a hand's force F_h, a row a direction, both in N; None of a
    run that is shorter than a period of VIBRATION."""
    T = float(np.diff(time).mean())
    count = max(1, round(1.0 / (VIBRATION * T)))
    if len(time) < count:
        return None
    mean = np.ones(count) / count
    F, E = (np.stack([np.convolve(row, mean, "valid") for row in rows]) for rows in (hand, error))
    felt, right, off = (reduce(np.hypot, each) for each in (F, F + E, E))
    size = np.abs(felt - right) / (FORCE * np.maximum(right, WEAKEST))
    cross = reduce(np.hypot, (F[i] * E[j] - F[j] * E[i] for i, j in combinations(range(len(F)), 2)))
    turned = np.degrees(np.arctan2(np.abs(cross), (F * (F + E)).sum(axis=0)))
    beyond = np.maximum(size, np.where(off > FORCE * WEAKEST, turned / DIRECTION, 0.0))
    worst = int(beyond.argmax())
    seconds = T * np.count_nonzero(beyond > 1.0)
    when = float(time[worst] + time[worst + count - 1]) / 2
    return NoticedError(
        float(seconds), T * len(beyond), float(off[worst]), float(felt[worst]), when
    )


def _of_handle(results: Results, user: UserSignals) -> Shaking | None:
    velocity = signal_of_user(HANDLE_VELOCITY, user.name)
    table = of_port(results, velocity)
    if table is None or results.record.scene["record"]["every"] > 1:
        return None
    lengths = space_of(results).lengths
    return shaking(table["time"], table.by_row(lambda v: v.T[:lengths], velocity))


def shaking(time: Vector, v: Vector) -> Shaking | None:
    """That of velocities in m/s, a row a direction; None of a run that is shorter than WINDOW, or
    too slow for vibrations."""
    T = float(np.diff(time).mean()) if len(time) > 1 else np.inf
    count = round(WINDOW / T)
    if 0.5 / T <= VIBRATION or len(time) <= count:
        return None
    hertz = np.fft.rfftfreq(count, T)
    band = slice(int(np.searchsorted(hertz, VIBRATION)), None)
    window = np.blackman(count)
    signs = np.where(2 * T * hertz[band] < 1 - ROUNDING, 2.0, 1.0)
    shares = signs / (count * (window @ window)) * np.sinc(hertz[band] * T) ** 2
    last = len(time) - 1 - count
    firsts = [*range(0, last, max(1, count // 4)), last]
    windows = sliding_window_view(np.diff(v) / T, count, axis=1)
    squares = np.empty(len(firsts))
    for k in range(0, len(firsts), AT_A_TIME):
        a = windows[:, firsts[k : k + AT_A_TIME]]
        spectrum = np.fft.rfft((a - a.mean(axis=2, keepdims=True)) * window)[..., band]
        powers = (np.abs(spectrum) ** 2).sum(axis=0)
        squares[k : k + AT_A_TIME] = [power @ shares for power in powers]
    at = int(np.fmax(squares, 0.0).argmax())  # numbers that are none do not shake
    middle = float(time[firsts[at]] + WINDOW / 2)
    return Shaking(float(np.sqrt(2.0 * max(squares[at], 0.0))), middle)


def describe_noticed(found: Mapping[str, Noticed]) -> Iterator[str]:
    """A sentence for each user."""
    for user, each in found.items():
        said: dict[str, list[str]] = {"notice": [], "perhaps": [], "not": []}
        if error := each.tracking:
            most = f"{short(error.error)} N beside {short(error.force)} N, at {error.time:.4g} s"
            span = f"for {short(error.seconds)} s of {short(error.of)} s, " * (error.seconds > 0)
            said["notice" if error.seconds else "not"].append(f"the tracking error ({span}{most})")
        if shaken := each.shaking:
            a = shaken.amplitude
            how = "notice" if a > SHAKING else "perhaps" if a > FAINTEST else "not"
            when = f", at {shaken.time:.4g} s" * (how != "not")
            said[how].append(f"shaking ({short(a)} m/s2 from {VIBRATION:g} Hz on{when})")
        parts = [
            f"{how} {(' or ' if how == 'not' else ' and ').join(what)}"
            for how, what in said.items()
            if what
        ]
        if not said["notice"]:
            parts[0] = parts[0].replace(" ", " notice ", 1)
        whose = f"the hand of {user}" if user else "a hand"
        yield f"by what attentive people can tell, {whose} would {', '.join(parts)}"
