"""Lengths of a device and offsets of its encoders from angles, and from places of the handle that
are known.

Of sample k the encoders tell q_k, of some the place y_k of the handle is known, too. Over geometry
and offsets theta and all places z_k

    min  sum |(angles(z_k, theta) + o - q_k)/resolution|^2 + |(handle(z_k, theta) - y_k)/sigma|^2

is solved by Gauss-Newton's method in which each z_k is eliminated by a QR factorisation of its own
rows (variable projection: G. H. Golub and V. Pereyra, SIAM Journal on Numerical Analysis 10 (1973)
413-432). What is left has a null space of what no sample can tell, the gauges; theta moves from
what is assumed by a step of least norm, so that it does not move along these. Those of every device
are named: where it stands, how it is turned, its size, where the handle is on its body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.analysis.fit.estimate import Estimate
from hapticlink.analysis.fit.log import read_columns
from hapticlink.components.component import Variable
from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.device.models import device_model
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.device import Device
from hapticlink.fmus.fmu_functions import GRAPHS
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.base.signal_names import DEVICE

ANGLES, PLACE = f"{DEVICE}.q", "place"
"""Columns of a log."""
POINTS = ("at_parent", "at_child", "at", "at1", "at2")
OFFSET = "offset"
SAMPLES = 2000
"""Samples that are taken of a log, evenly."""
SIGMA = 1e-4
"""Standard deviation (m) of a place that is known."""
SCALES = {"m": 1e-3, "rad": 1e-3}
"""Changes of unknowns that are of one size, by unit."""
NONE, STEPS, STILL = 1e-6, 40, 1e-7
"""Of the largest singular value, below which nothing is told; most steps, and the step in SCALES at
which they end."""


@dataclass(frozen=True)
class Unknown:
    """An entry of theta: the parameter and its entry, or the offset of an encoder."""

    name: str
    entry: int
    unit: str
    assumed: float

    @property
    def key(self) -> str:
        return f"{self.name}[{self.entry + 1}]"


@dataclass(frozen=True)
class FittedKinematics:
    """What a log tells of the kinematics of a device. estimates: of all unknowns (SI), with
    infinite spreads where a value cannot be told; gauges: the reasons, each with the unknowns that
    it takes part in; counts: root mean square of the errors at the encoders before and after; told:
    how many combinations of the unknowns can be told."""

    estimates: tuple[Estimate, ...]
    gauges: Mapping[str, tuple[str, ...]]
    counts: tuple[float, float]
    told: int

    def lines(self) -> Iterator[str]:
        yield from (each.text for each in self.estimates if np.isfinite(each.spread))
        yield f"{self.told} of {len(self.estimates)} unknowns can be told"
        for gauge, names in self.gauges.items():
            yield f"cannot be told: {gauge}; it takes {', '.join(names)}: give some as known"
        before, after = self.counts
        yield f"errors at the encoders: {before:.3g} counts rms before, {after:.3g} after"

    def record(self) -> dict[str, Any]:
        """The content of fit.json."""
        return {
            "parameters": {each.key: each.record() for each in self.estimates},
            "told": self.told,
            "gauges": {gauge: list(names) for gauge, names in self.gauges.items()},
            "encoder_errors_counts": list(self.counts),
        }


def fit_kinematics(
    device: Device, angles: Matrix, places: Matrix | None = None, known: Sequence[str] = ()
) -> FittedKinematics:
    """From angles of the encoders (n, e) and, where they are known, places of the handle (n, 2).
    known: parameters, or offsets of encoders, that are not searched. Raises InputFault for names
    that the device does not have, and where nothing at all can be told."""
    with GRAPHS:
        problem = _Problem(device_model(device), known, places is not None)
    step = max(len(angles) // SAMPLES, 1)
    taken = angles[::step]
    at = None if places is None else places[::step]
    try:
        theta, z, first = problem.searched(taken, at)
        A, r, counts = problem.projected(theta, z, taken, at)
        _, s, Vt = np.linalg.svd(A)
    except np.linalg.LinAlgError:
        raise InputFault(
            "the search for its kinematics leads nowhere: the log tells too little of them. Let "
            "the handle go through its workspace, or give more of them as known (--known NAME,...)"
        ) from None
    rank = int(np.count_nonzero(s > NONE * max(s.max(initial=0.0), 1e-300)))
    if not rank or s.max(initial=0.0) < NONE:
        raise InputFault(
            "nothing of its kinematics can be told: it has no more encoders than directions, and "
            "any lengths suit any angles: add known places of the handle (columns place[1], "
            "place[2], m)"
        )
    null, own = Vt[rank:], Vt[:rank]
    noise = np.sqrt(r @ r / max(len(r) - rank - z.size, 1))
    spreads = problem.scales * noise * np.sqrt(((own / s[:rank, None]) ** 2).sum(axis=0))
    free = (null**2).sum(axis=0) > NONE**2
    spreads = np.where(free, np.inf, spreads)
    return FittedKinematics(
        tuple(
            Estimate(u.key, u.unit, float(value), float(spread), u.assumed)
            for u, value, spread in zip(problem.unknowns, theta, spreads, strict=True)
        ),
        problem.name_gauges(null, theta),
        (first, counts),
        rank,
    )


class _Problem:
    """Residuals of a device and their slopes, by sample."""

    def __init__(self, model: DeviceModel, known: Sequence[str], with_places: bool) -> None:
        self._model, device = model, model.device
        geometry = [v for v in body_parameters(device.linkage) if _is_point(v)]
        sensed = [e.joint.name for e in device.encoders]
        names = [*(v.name for v in geometry), *(f"{OFFSET}.{name}" for name in sensed)]
        for name in known:
            if name not in names:
                raise InputFault(f"--known: {unknown('parameter', name, names)}")
        places = {j.name for j in device.joint if j.parent == "ground"}
        found = []
        for v in geometry:
            of_ground = v.name.removesuffix(".at_parent") in places or self._on_ground(v.name)
            for i, value in enumerate(v.starts):
                # Along a body's own axes its first point is what a joint's zero is counted from.
                if v.name not in known and (value or of_ground):
                    found.append(Unknown(v.name, i, "m", value))
        for i, e in enumerate(device.encoders):
            if (name := f"{OFFSET}.{e.joint.name}") not in known:
                found.append(Unknown(name, i, e.joint.kind.units[0], 0.0))
        z, theta = ca.SX.sym("z", len(model.start_place)), ca.SX.sym("theta", len(found))
        p = dict(model.numbers)
        offsets = ca.SX(len(sensed), 1)
        for k, u in enumerate(found):
            if u.name.startswith(f"{OFFSET}."):
                offsets[u.entry] = theta[k]
            else:
                p[u.name] = ca.SX(p[u.name])
                p[u.name][u.entry] = theta[k]
        resolutions = ca.DM([e.resolution for e in device.encoders])
        angles = (model.angles(z, p) + offsets) / resolutions
        handle = model.handle(z, p)[:2] / SIGMA
        r = ca.vertcat(angles, handle) if with_places else angles
        J = ca.jacobian(r, theta)
        depends = [bool(J[:, k].nnz()) for k in range(len(found))]
        self.unknowns = tuple(u for u, acts in zip(found, depends, strict=True) if acts)
        kept = [k for k, acts in enumerate(depends) if acts]
        self._all = np.array([u.assumed for u in found])
        self._kept = np.array(kept, int)
        self.assumed = self._all[self._kept]
        self.scales = np.array([SCALES[u.unit] for u in self.unknowns])
        self._resolutions = np.array(resolutions).ravel()
        self._r = ca.Function(
            "r", [z, theta], [r, ca.jacobian(r, z), J[:, kept] if kept else ca.SX(r.numel(), 0)]
        )
        q = ca.SX.sym("q", len(sensed))
        nearest = model.place_from_angles(q, z, model.numbers, 6)
        self._place = ca.Function("place", [q, z], [nearest])

    def _on_ground(self, name: str) -> bool:
        """Whether an end of a loop is on the ground."""
        loop, _, end = name.partition(".")
        if not (loop.startswith("loop") and end in ("at1", "at2")):
            return False
        return self._model.device.loop[int(loop[4:]) - 1].bodies[int(end[2]) - 1] == "ground"

    def first_places(self, angles: Matrix) -> Matrix:
        """Places of all samples by the device as it is assumed, each from the one before."""
        z, found = self._model.start_place, []
        for q in angles:
            near = np.array(self._place(q, z)).ravel()
            z = near if np.isfinite(near).all() else self._model.start_place
            found.append(z)
        return np.array(found)

    def nearest(self, theta: Vector, z: Matrix, angles: Matrix, places: Matrix | None) -> Matrix:
        """The places that fit best with this theta, by some steps of Gauss-Newton."""
        for _ in range(3):
            r, Jz, _ = self._samples(theta, z, angles, places)
            Jt = Jz.transpose(0, 2, 1)
            z = z - np.linalg.solve(Jt @ Jz, Jt @ r[:, :, None])[:, :, 0]
        return z

    def searched(self, angles: Matrix, places: Matrix | None) -> tuple[Vector, Matrix, float]:
        """Theta, the places that fit best with it, and the errors at the encoders before. Raises
        LinAlgError where the search does not converge."""
        theta, z = self.assumed, self.first_places(angles)
        first = np.inf
        for _ in range(STEPS):
            z = self.nearest(theta, z, angles, places)
            A, r, counts = self.projected(theta, z, angles, places)
            first = counts if first == np.inf else first
            U, s, Vt = np.linalg.svd(A, full_matrices=False)
            kept = s > NONE * max(s.max(initial=0.0), 1e-300)
            move = -(Vt[kept].T / s[kept]) @ (U.T[kept] @ r)
            theta = theta + self.scales * move
            if np.abs(move).max(initial=0.0) < STILL:
                return theta, self.nearest(theta, z, angles, places), first
        raise np.linalg.LinAlgError

    def projected(
        self, theta: Vector, z: Matrix, angles: Matrix, places: Matrix | None
    ) -> tuple[Matrix, Vector, float]:
        """Slopes by theta in SCALES and residuals, without what the places take up; and the root
        mean square of the errors at the encoders (counts)."""
        r, Jz, J = self._samples(theta, z, angles, places)
        Q, _ = np.linalg.qr(Jz, mode="complete")
        left = Q[:, :, Jz.shape[2] :].transpose(0, 2, 1)
        A = (left @ J * self.scales).reshape(-1, len(self.scales))
        errors = r[:, : angles.shape[1]]
        return A, (left @ r[:, :, None]).ravel(), float(np.sqrt(np.mean(errors**2)))

    def _samples(
        self, theta: Vector, z: Matrix, angles: Matrix, places: Matrix | None
    ) -> tuple[Matrix, Matrix, Matrix]:
        """Residuals (n, r), and their slopes by places (n, r, k) and theta (n, r, t)."""
        whole, n = self._all.copy(), len(z)
        whole[self._kept] = theta
        found = [np.array(each) for each in self._r.map(n)(z.T, np.tile(whole[:, None], n))]
        measured = angles / self._resolutions
        if places is not None:
            measured = np.hstack([measured, places / SIGMA])
        size = len(found[0])
        r = found[0].T - measured
        Jz, J = (each.reshape(size, n, -1).transpose(1, 0, 2) for each in found[1:])
        return r, Jz, J

    # --- what cannot be told ----------------------------------------------------------------

    def name_gauges(self, null: Matrix, at: Vector) -> dict[str, tuple[str, ...]]:
        """The directions of `null` (in SCALES) in words, with the unknowns of each."""
        named: dict[str, tuple[str, ...]] = {}
        left = null.copy()
        for words, moves in self._candidates(at).items():
            for move in moves:
                unit = move / self.scales
                if not (size := np.linalg.norm(unit)):
                    continue
                unit = unit / size
                if np.linalg.norm(unit - null.T @ (null @ unit)) < 1e-3:
                    named[words] = named.get(words, ()) + self._names(unit)
                    left = left - np.outer(left @ unit, unit)
        named = {words: tuple(dict.fromkeys(names)) for words, names in named.items()}
        _, s, Vt = np.linalg.svd(left) if len(left) else (None, np.zeros(0), left)
        for direction in Vt[: int(np.count_nonzero(s > 0.5))]:
            named[f"these together ({len(named) + 1})"] = self._names(direction)
        return named

    def _names(self, direction: Vector) -> tuple[str, ...]:
        large = np.abs(direction) > 1e-3
        return tuple(u.key for u, is_in in zip(self.unknowns, large, strict=True) if is_in)

    def _candidates(self, at: Vector) -> dict[str, list[Vector]]:
        """The changes that alter nothing which encoders of a device tell, where all that they
        change is unknown: each a rate of the unknowns."""
        device = self._model.device
        on_ground = {f"{j.name}.at_parent" for j in device.joint if j.parent == "ground"}
        on_ground |= {u.name for u in self.unknowns if self._on_ground(u.name)}
        turned = {f"{OFFSET}.{j.name}" for j in device.joint
                  if j.parent == "ground" and j.type == "revolute"}  # fmt: skip
        body = device.handle.body
        on_handle = {f"{j.name}.at_child" for j in device.joint if j.child == body}
        on_handle |= {f"{j.name}.at_parent" for j in device.joint if j.parent == body}
        on_handle |= {
            f"loop{i + 1}.at{k + 1}"
            for i, c in enumerate(device.loop)
            for k in range(2)
            if c.bodies[k] == body
        }
        values = dict(zip([u.key for u in self.unknowns], at, strict=True))

        def rate(u: Unknown, kind: str, axis: int = 0) -> float:
            if kind == "place":
                return float(u.name in on_ground and u.entry == axis)
            if kind == "handle":
                return float(u.name in on_handle and u.entry == axis)
            if kind == "turn":
                if u.name in turned:
                    return -1.0
                other = values.get(f"{u.name}[{2 - u.entry}]", 0.0)
                return (other if u.entry else -other) if u.name in on_ground else 0.0
            return values[u.key] if u.unit == "m" and not u.name.startswith(OFFSET) else 0.0

        def moves(kind: str, *axes: int) -> list[Vector]:
            return [np.array([rate(u, kind, axis) for u in self.unknowns]) for axis in axes]

        return {
            "where the device stands": moves("place", 0, 1),
            "how it is turned": moves("turn", 0),
            "its size": moves("size", 0),
            "where the handle is on its body": moves("handle", 0, 1),
        }


def read_angles(path: Path | str, device: Device) -> tuple[Matrix, Matrix | None]:
    """Angles of the encoders (n, e) of a log (`log.read_columns`), and the known places of the
    handle (n, 2) where it has them. Raises InputFault for a log without the angles."""
    path, table = read_columns(path)
    n = len(device.encoders)
    if ANGLES not in table or table[ANGLES].shape[1:] != (n,):
        raise InputFault(
            f"{path}: it needs {ANGLES}[1] to [{n}], the angles of the encoders (a run has them "
            f"with its observer beside the device, or with a board); it has "
            f"{', '.join(table.columns[:20])}"
        )
    places = table.get(PLACE)
    if places is not None and places.shape[1:] != (2,):
        raise InputFault(f"{path}: {PLACE}[1] and {PLACE}[2] (m) are where the handle was")
    return table[ANGLES], places


def _is_point(v: Variable) -> bool:
    return v.name.rpartition(".")[2] in POINTS
