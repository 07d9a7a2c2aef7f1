"""How a scene feels: what the hand meets at the handle, against the mechanism that it should meet.

At a pose, with the hand cut off, the compliance X(w) of the handle (stability/port_response.py) is
compared with that of the mechanism, -Lambda^-1/w^2, both scaled by S = diag(1, 1, L), L the mean
link length (m), so that all entries are in m/N. With e_i and 1/m_i the eigenvectors and eigenvalues
of S Lambda^-1 S, E = (e_i) the free directions, p_j the constrained ones, whose eigenvalues are 0,

    M(w) = -(E' S X S E)^-1/w^2         M e_i is met when moving along e_i, ideally m_i e_i
    error_i = |M e_i - m_i e_i|/m_i     of that force, in size, phase and direction
    angle_i                             between Re M e_i and e_i
    k_j(w) = 1/|p_j' S X S p_j|         felt stiffness (N/m), ideally infinite

A force is right where its error is below the differential threshold of a person. Springs, dampers
and gravity of the mechanism are not in the ideal.

X is met by a hand that keeps the loop steady. So its eigenvalues are judged first, let go and in
the hands of `stability`, and where some grow that is said before all numbers.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.findings.noticed import DIRECTION, FORCE
from hapticlink.analysis.search.settings import Scales
from hapticlink.analysis.stability.hand_cases import Case, InHands
from hapticlink.analysis.stability.hands import FREE, free, hands_in
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.port_response import hand_port, response
from hapticlink.analysis.stability.poses import Pose, choose_evenly_spaced, fault_of, simulate_scene
from hapticlink.analysis.stability.resting_scene import RestingScene, resting
from hapticlink.analysis.stability.short_hyperperiod import short as short_hyperperiod
from hapticlink.analysis.stability.stand_in import StandIn, find_stand_ins, record_stand_ins
from hapticlink.analysis.tune.felt_stiffness import CONSTRAINED, RIGID, mobility
from hapticlink.analysis.tune.stability_limits import Judge
from hapticlink.components.dynamics.rendered_directions import (
    WHOLE,
    RenderedDirections,
    rendered_directions,
)
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.arrays import Complex, Matrix, Vector
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.base.terminal_output import align_columns
from hapticlink.orchestrator.base.ticks import exact, write_exact
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.scene.scene import Scene

HERTZ = np.geomspace(0.5, 50.0, 41)
"""The frequencies, up to the fastest that a hand is moved at and beyond."""
SLOW = 2.0
"""The frequency (Hz) of the numbers of a direction."""


@dataclass(frozen=True)
class Direction:
    """A free direction: a unit vector (m, m, rad times L), the mechanism's inertia (kg), and by
    frequency the felt one (complex), the error of the force, and the angle of it (degrees)."""

    along: Vector
    inertia: float
    felt: Complex
    error: Vector
    angle: Vector

    @property
    def right_up_to(self) -> float:
        """The frequency (Hz) up to which force and direction are within what a person can tell."""
        return first(np.maximum(self.error / FORCE, self.angle / DIRECTION))


@dataclass(frozen=True)
class Constraint:
    """A constrained direction, a unit vector, and its felt stiffness (N/m) by frequency."""

    along: Vector
    stiffness: Vector

    @property
    def slow(self) -> float:
        """The stiffness (N/m) at SLOW; infinite where nothing gives way."""
        return at_slow(self.stiffness)


@dataclass(frozen=True)
class Transparency:
    """How a scene feels at a pose of its run. growing: the cases, of a handle that is let go and of
    the hands of `stability`, in which something grows by more than a drift; steady_in: the hands in
    which nothing does. stand_ins: what stands for FMUs whose state cannot be read. rounded: which
    graphics rate is judged in place of one with which events hardly repeat."""

    title: str
    pose: str
    free: tuple[Direction, ...]
    constrained: tuple[Constraint, ...]
    space: PortSpace = PLANE
    growing: tuple[Case, ...] = ()
    steady_in: tuple[str, ...] = ()
    stand_ins: tuple[StandIn, ...] = ()
    rounded: str = ""

    @property
    def right_up_to(self) -> float:
        """The least frequency (Hz) up to which a free direction is right."""
        return min((d.right_up_to for d in self.free), default=np.nan)

    @property
    def width(self) -> float:
        """Z-width of the loop at SLOW: the impedance of the stiffest constrained direction, k/w,
        over that of the lightest free one, w m."""
        w, light = 2 * np.pi * SLOW, min((abs(at_slow(d.felt)) for d in self.free), default=np.nan)
        return max((c.slow for c in self.constrained), default=np.nan) / (w * w * light)

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield f"at {self.pose}:"
        yield from self._unstable()
        if self.rounded:
            yield f"  {self.rounded}"
        for each in self.stand_ins:
            yield f"  {each}"
        if self.growing and not self.steady_in:
            return
        for d in self.free:
            felt, w = complex(at_slow(d.felt)), 2 * np.pi * SLOW
            inert = f"{short(felt.real)} kg"
            if felt.real < 0.0:  # pressed against something
                inert = f"a spring of {short(-felt.real * w * w)} N/m"
            turned = f", turned by {short(float(at_slow(d.angle)))} degrees" * (felt.real > 0.0)
            along = _name_direction(self.space, d.along)
            yield (
                f"  along {along} a mechanism of {short(d.inertia)} kg is felt as {inert} "
                f"and {short(-w * felt.imag)} N.s/m at {SLOW:g} Hz{turned}; right "
                f"up to {_hertz(d.right_up_to)}"
            )
        for c in self.constrained:
            stiff = "rigid" if np.isinf(c.slow) else f"{short(c.slow)} N/m at {SLOW:g} Hz"
            yield f"  against {_name_direction(self.space, c.along)}, which is constrained: {stiff}"
        if self.constrained and self.free:
            yield (
                f"  Z-width (constrained over free impedance at {SLOW:g} Hz): {_width(self.width)}"
            )

    def _unstable(self) -> Iterator[str]:
        """In which hands the loop is unstable, and in which what is felt is felt."""
        for case in self.growing:
            where = "when let go" if case.free else f"in {case.hand}"
            grows = f"a {case.kind} of {short(case.hertz)} Hz grows at {short(case.growth)} 1/s"
            yield f"  unstable {where}: {grows}"
        if self.growing:
            hands = ", ".join(self.steady_in)
            steady = f"what follows is felt in a hand that keeps it steady: {hands}"
            yield f"  {steady if hands else 'no hand that was tried feels it steadily'}"

    def record(self) -> dict[str, Any]:
        """The part of transparency.json on this pose."""
        return {
            "pose": self.pose,
            "unstable": [case.record() for case in self.growing],
            "steady_in": list(self.steady_in),
            "rounded": self.rounded,
            **record_stand_ins(self.stand_ins),
            "right_up_to": self.right_up_to,
            "frequencies": HERTZ.tolist(),
            "free": [
                {
                    "along": d.along.tolist(),
                    "inertia": d.inertia,
                    "felt_inertia": d.felt.real.tolist(),
                    "felt_damping": (0.0 - 2 * np.pi * HERTZ * d.felt.imag).tolist(),
                    "error": d.error.tolist(),
                    "angle": d.angle.tolist(),
                    "right_up_to": d.right_up_to,
                }
                for d in self.free
            ],
            "constrained": [
                {"along": c.along.tolist(), "stiffness": c.stiffness.tolist()}
                for c in self.constrained
            ],
        }


@one_blas_thread()
def transparency(
    scene: str | Path | Scene, options: Sequence[str] = (), *, count: int = 2
) -> list[Transparency]:
    """How a scene feels at `count` poses of its own run, held there by a spring that is cut off
    again. Raises InputFault for a scene without device, controller or linkage, and where no pose
    has an equilibrium."""
    read = open_scene.load(scene, options)
    poses, (judged, rounded) = _visit_poses(read, count), short_hyperperiod(read)
    found, why = [], ""
    for pose in poses:
        try:
            with resting(judged, pose.held, at=pose.start) as place:
                felt = _measure_felt(read, place, pose.name, {})
                found.append(replace(felt, rounded=rounded))
        except (InputFault, FmuFault) as fault:
            why = f"{pose.name}: {fault}"
    if not found:
        raise InputFault(f"no pose of the run has an equilibrium: {why}")
    return found


def _visit_poses(read: Scene, count: int) -> list[Pose]:
    """Poses of the scene's own run, which is said where it fails."""
    linkage = _linkage(read)
    run = simulate_scene(read)
    if why := fault_of(run):
        warning = "warning: the scene's own run fails: %s; its poses are those up to there"
        logging.getLogger(__name__).warning(warning, why)
    return choose_evenly_spaced(run, linkage, count)


def _measure_felt(read: Scene, place: RestingScene, name: str, scales: Scales) -> Transparency:
    cut = response(place.period(scales), hand_port(place.map.system))
    X = np.array([cut.compliance(hertz, place.T) for hertz in HERTZ])
    rendered = rendered_directions(read.device.handle if read.device else None, read.space)
    length = mean_link_length(_linkage(read))
    found = of(read.title, name, X, mobility(place), length, rendered)
    judged = InHands(place, scales)
    cases = judged.cases(name, {FREE: free(), **hands_in(read.space)}, DRIFT)
    growing = tuple(case for case in cases if _grows(case))
    steady = tuple(case.hand for case in cases if not (case.free or case in growing))
    stand_ins = find_stand_ins(place.map.work.responses)
    return replace(found, growing=growing, steady_in=steady, stand_ins=stand_ins)


def _grows(case: Case) -> bool:
    return case.verdict == "unstable" and not case.drifts


def of(
    title: str,
    pose: str,
    X: Complex,
    mobility: Matrix,
    length: float,
    rendered: RenderedDirections = WHOLE,
) -> Transparency:
    """The transparency of a handle with the compliances X (k, 3, 3) at HERTZ, for a mechanism of a
    mobility Lambda^-1 (3, 3) with links of a mean length (m), in the directions that a device
    renders."""
    S, w = np.diag(np.array(rendered.space.scaling(length), float)), 2 * np.pi * HERTZ
    felt = np.array(rendered.rows)
    values, vectors = np.linalg.eigh(felt @ S @ rendered.felt_mobility(mobility) @ S @ felt.T)
    moves, vectors = values > CONSTRAINED * values[-1], felt.T @ vectors
    E, P = vectors[:, moves], vectors[:, ~moves].T
    X = S @ X @ S
    solved = np.linalg.inv(E.T @ X @ E)
    M = np.asarray(-solved / (w * w)[:, None, None], np.complex128)
    free = [
        _direction(E[:, i], M[:, :, i], i, 1.0 / value) for i, value in enumerate(values[moves])
    ]
    gives = [np.abs(np.einsum("i,kij,j->k", p, X, p)) for p in P]
    stiff = [np.where(x * RIGID > 1.0, 1.0 / np.maximum(x, 1e-300), np.inf) for x in gives]
    constrained = [Constraint(p, k) for p, k in zip(P, stiff, strict=True)]
    return Transparency(title, pose, tuple(free), tuple(constrained), rendered.space)


def _direction(along: Vector, column: Complex, i: int, inertia: float) -> Direction:
    """A direction from the column (k, n) of M."""
    off = column.copy()
    off[:, i] -= inertia
    real = column.real
    angle = np.degrees(np.arccos(np.clip(real[:, i] / np.linalg.norm(real, axis=1), -1.0, 1.0)))
    return Direction(along, inertia, column[:, i], np.linalg.norm(off, axis=1) / inertia, angle)


@dataclass(frozen=True)
class ChangeCost:
    """How a scene feels with a change, and `times`, the factor on its stiffnesses (dampings by its
    root) up to which it is stable in spring hands, with `stiffest`, how it feels there; None
    without gains or where it is not stable with any."""

    change: str
    felt: Transparency
    times: float | None
    stiffest: Transparency | None

    def cells(self) -> tuple[str, ...]:
        """The row of a table, without the change."""
        kg = ", ".join(short(float(at_slow(d.felt).real)) for d in self.felt.free)
        if self.felt.growing:
            where = "when let go" if self.felt.growing[0].free else "in some hands"
            kg = f"{kg}; unstable {where}" if self.felt.steady_in else "unstable in all hands tried"
        stiff, most = (_stiffness(f) if f else "-" for f in (self.felt, self.stiffest))
        times = f"{short(self.times)} times" if self.times else "-"
        width = _width(self.felt.width) if self.felt.constrained else "-"
        widest = _width(self.stiffest.width) if self.stiffest and self.felt.constrained else "-"
        return kg, _hertz(self.felt.right_up_to), stiff, width, times, most, widest

    def record(self) -> dict[str, Any]:
        """The part of transparency.json on this change."""
        most = self.stiffest.record() if self.stiffest else None
        return self.felt.record() | {"stable_up_to": self.times, "stiffest": most}


@one_blas_thread()
def costs(
    scene: str | Path | Scene, options: Sequence[str], tell: Callable[[str], object]
) -> list[ChangeCost]:
    """How the scene feels at its start with other rates, delays and holds, and how stiff it can be
    made."""
    read = open_scene.load(scene, options)
    pose = _visit_poses(read, 1)[0]
    rate = float(exact(read.haptics.rate))
    late = {"motors": ("controller.F_motor",), "handle": ("controller.x_D", "controller.v_D")}
    late["mechanism"] = ("virtual_mechanism.x", "virtual_mechanism.v")
    changes: dict[str, dict[str, object]] = {"as it is": {}}
    for name, factor in (("half", 0.5), ("twice", 2.0)):
        changes[f"{name} the haptic rate"] = {"haptics.rate": factor * rate}
        if read.graphics is not None and isinstance(read.graphics.rate, int | float | str):
            changed_rate = write_exact(Fraction(factor) * exact(read.graphics.rate))
            changes[f"{name} the graphics rate"] = {"graphics.rate": changed_rate}
    for name, ports in late.items():
        changes[f"{name} a haptic period late"] = {"delays": dict.fromkeys(ports, 1.0 / rate)}
    if read.graphics is not None:
        changes |= {f"hold {n}": {"hold": n} for n in ("zoh", "foh", "second-order", "smooth")}
    found = []
    for name, change in changes.items():
        try:
            judged, rounded = short_hyperperiod(open_scene.load(read, change))
            with resting(judged, pose.held, at=pose.start) as place:
                cost = _cost(read, place, name)
                found.append(replace(cost, felt=replace(cost.felt, rounded=rounded)))
        except (InputFault, FmuFault) as fault:
            tell(f"  {name}: {fault}")
    return found


def _cost(read: Scene, place: RestingScene, change: str) -> ChangeCost:
    felt = _measure_felt(read, place, change, {})
    try:
        judge = Judge({change: place})
        times = judge.margin({})
        return ChangeCost(
            change,
            felt,
            times,
            _measure_felt(read, place, change, dict.fromkeys(judge.laws, times)),
        )
    except (InputFault, FmuFault):
        return ChangeCost(change, felt, None, None)


HEADS = (
    "", f"felt at {SLOW:g} Hz (kg)", "right up to", "constraint (N/m)", "Z-width",
    "gains stable up to", "constraint then", "Z-width then",
)  # fmt: skip


def cost_lines(found: Sequence[ChangeCost]) -> Iterator[str]:
    """The costs as a table, what changes nothing in one row; and which are of other rates."""
    rows: dict[tuple[str, ...], list[str]] = {}
    others: dict[str, list[str]] = {}
    for cost in found:
        rows.setdefault(cost.cells(), []).append(cost.change)
        others.setdefault(cost.felt.rounded, []).append(cost.change)
    table = [HEADS, *((", ".join(names), *cells) for cells, names in rows.items())]
    yield from align_columns(table)
    yield from (f"{rounded}: {', '.join(names)}" for rounded, names in others.items() if rounded)


def _stiffness(felt: Transparency) -> str:
    slow = [c.slow for c in felt.constrained]
    return "none" if not slow else "rigid" if np.isinf(max(slow)) else short(max(slow))


def _width(width: float) -> str:
    return "infinite" if np.isinf(width) else short(width)


def _linkage(read: Scene) -> Linkage:
    if not (read.linkage and read.device and read.controller):
        raise InputFault("no rendering to feel: a [linkage], [device] and [controller] are needed")
    return read.linkage


def first(ratio: Vector) -> float:
    """The frequency (Hz) at which a ratio first reaches 1, on straight lines over the logarithm;
    0 where it does at once, infinite where it never does."""
    beyond = np.flatnonzero(ratio > 1.0)
    if not len(beyond):
        return float(np.inf)
    i = int(beyond[0])
    if i == 0:
        return 0.0
    share = (1.0 - ratio[i - 1]) / (ratio[i] - ratio[i - 1])
    return float(HERTZ[i - 1] * (HERTZ[i] / HERTZ[i - 1]) ** share)


def at_slow(values: Any) -> Any:
    """The value at the frequency next to SLOW."""
    return values[int(np.argmin(np.abs(HERTZ - SLOW)))]


def _hertz(frequency: float) -> str:
    if np.isinf(frequency):
        return f"{HERTZ[-1]:g} Hz and beyond"
    return f"{short(frequency)} Hz" if frequency else f"less than {HERTZ[0]:g} Hz"


def _name_direction(space: PortSpace, along: Vector) -> str:
    """Its lengths, and after these what is about an axis."""
    forward = along if along[int(np.argmax(np.abs(along)))] > 0 else -along
    parts = np.split(forward, [space.lengths])
    return (
        f"({'; '.join(', '.join(f'{entry:.2f}' for entry in part) for part in parts if len(part))})"
    )
