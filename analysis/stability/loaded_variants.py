"""The spectral radius of many variants of a scene, with FMUs that stay loaded between them.

Where the next variant differs in tunable parameters alone, they are set in the loaded FMUs, and the
search for its equilibrium starts from that of the variant before.
"""

from __future__ import annotations

from collections.abc import Hashable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from hapticlink.analysis.stability.equilibrium import equilibrium, nearby
from hapticlink.analysis.stability.lifted_map import LiftedMap, lifted_map, long_enough
from hapticlink.analysis.stability.linearisable_scene import linearisable
from hapticlink.analysis.stability.linearisation import Linearisation
from hapticlink.analysis.stability.modes import counted, modes
from hapticlink.analysis.stability.radius_verdict import verdict
from hapticlink.analysis.stability.trajectory import trajectory
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.faults import Fault
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System


@dataclass(frozen=True)
class Verdict:
    """The spectral radius of a variant over its hyperperiod (s), and its uncertainty."""

    radius: float
    uncertainty: float
    period: float

    @property
    def verdict(self) -> str:
        return verdict(self.radius, self.uncertainty)

    @property
    def growth(self) -> float:
        """Growth rate (1/s)."""
        return float(np.log(max(self.radius, 1e-300))) / self.period


class LoadedVariants:
    """Judges variants of `scene`, one after the other; as a context manager it unloads the FMUs."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._open = ExitStack()
        self._map: LiftedMap | None = None
        self._kind: Hashable = None
        self._equilibrium: Vector | None = None
        self._set_anew = False
        self._starts: dict[tuple[str, str], tuple[Scalar, float]] = {}
        self.loads = 0

    def __enter__(self) -> LoadedVariants:
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def judge(self, options: Options) -> Verdict:
        """The verdict on the scene with `options`. Raises InputFault as `stability` does."""
        with linearisable(self._scene, options) as (read, system, _):
            system = long_enough(read, system)
            map_ = self._prepared(read, system)
            try:
                linear = None if self._equilibrium is None else nearby(map_, self._equilibrium)
                if linear is None:
                    map_ = self._fresh(read, system)
                    linear = equilibrium(map_, trajectory(map_, read.duration))
            except Fault:
                self._open.close()
                self._kind = None
                raise
            self._equilibrium = linear.point
            return _verdict(linear, map_.period)

    def _prepared(self, read: Scene, system: System) -> LiftedMap:
        kind, starts = _kind(system), _starts(system)
        if kind == self._kind and self._map and self._set(self._map, starts):
            return self._map
        self._open.close()
        self._map = self._open.enter_context(lifted_map(system, 0.0, read))
        self._equilibrium = None
        self._kind, self._starts, self._set_anew = kind, starts, False
        self.loads += 1
        return self._map

    def _fresh(self, read: Scene, system: System) -> LiftedMap:
        """The map from the start of the scene on, which is run again where parameters were set
        since."""
        if self._set_anew:
            self._kind = None
        return self._prepared(read, system)

    def _set(self, map_: LiftedMap, starts: dict[tuple[str, str], tuple[Scalar, float]]) -> bool:
        """Sets the parameters that differ; False where that takes another FMU."""
        if starts.keys() != self._starts.keys():
            return False
        changed = [(k, v) for k, v in starts.items() if v[1] != self._starts[k][1]]
        if any(v[0].causality != "parameter" or v[0].variability != "tunable" for _, v in changed):
            return False
        map_.set_parameters([(fmu, scalar, value) for (fmu, _), (scalar, value) in changed])
        self._starts, self._set_anew = starts, self._set_anew or bool(changed)
        return True


def _verdict(linear: Linearisation, period: float) -> Verdict:
    judged = counted(modes(linear, period))
    if not judged:
        return Verdict(0.0, 0.0, period)
    return Verdict(abs(judged[0].z), judged[0].uncertainty, period)


def _kind(system: System) -> Hashable:
    """What two systems share whose parameters alone differ."""
    time = system.timeline
    paces = tuple((c.name, c.first, c.longest, c.shortest, len(c.starts)) for c in time.clocks)
    fmus = tuple((f.name, f.description.guid, f.clock) for f in system.fmus)
    return time.base, paces, fmus, tuple(map(repr, system.connections)), system.coupling.scheme


def _starts(system: System) -> dict[tuple[str, str], tuple[Scalar, float]]:
    return {
        (f.name, scalar.name): (scalar, value)
        for f in system.fmus
        for scalar, value in f.starts
        if not isinstance(value, str)
    }
