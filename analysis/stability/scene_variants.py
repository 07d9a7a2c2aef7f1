"""The spectral radius of many variants of a scene, in its own hand, with FMUs that stay loaded.

Where the next variant differs in tunable parameters alone, they are set in the loaded FMUs, and the
search for its equilibrium starts from that of the variant before.
"""

from __future__ import annotations

from collections.abc import Hashable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from hapticlink.analysis.stability.hand_slopes import hand_slopes
from hapticlink.analysis.stability.modes import judged_modes, modes, verdict
from hapticlink.analysis.stability.passivity import Passivity
from hapticlink.analysis.stability.passivity import of as passivity_of
from hapticlink.analysis.stability.port_response import LARGEST, forces, hand_port
from hapticlink.analysis.stability.poses import in_own_hand
from hapticlink.analysis.stability.resting_scene import RestingScene
from hapticlink.analysis.stability.smooth_scene import linearisable
from hapticlink.components.specs.hand import Hand
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import (
    Fault,
    FmuFault,
    InputFault,
    Interrupted,
)
from hapticlink.orchestrator.base.signal_names import HAND
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System

Starts = dict[tuple[str, str], tuple[Scalar, float]]


@dataclass(frozen=True)
class Radius:
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


class SceneVariants:
    """Judges variants of `scene`, one after the other; as a context manager it unloads the FMUs."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._open = ExitStack()
        self._place: RestingScene
        self._hand: Hand | None = None
        self._kind: Hashable = None
        self._starts: Starts = {}
        self.loads = 0
        self.removed: list[str] = []
        """What the last variant is judged without, a line on each."""

    def __enter__(self) -> SceneVariants:
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def judge(self, options: Options) -> Radius:
        """The spectral radius of the scene with `options`, around its equilibrium in its own hand.
        Raises InputFault and FmuFault where it has none."""
        self._rest(options)
        place, hand = self._place, self._hand
        held = {HAND: hand_slopes(hand, place.T, place.space)} if hand else {}
        period = place.period({}).held(held)
        leading = judged_modes(modes(period.linear, self._place.map.period))[:1]
        radius, uncertainty = (abs(leading[0].z), leading[0].uncertainty) if leading else (0.0, 0.0)
        return Radius(radius, uncertainty, self._place.map.period)

    def port(self, options: Options) -> Passivity:
        """The passivity of the user's port of the scene with `options`, without its two-port.
        Raises as `judge` and `passivity`."""
        self._rest(options)
        hand = hand_port(self._place.map.system)
        if (count := forces(self._place.map, hand, None)) > LARGEST:
            raise InputFault(f"user's port: {count} forces in a hyperperiod, at most {LARGEST}")
        return passivity_of(self._scene.title, self._place.period({}), hand, None, self._place.T)

    def _rest(self, options: Options) -> None:
        """Puts the scene with `options` at its equilibrium."""
        read = open_scene.load(self._scene, options)
        with linearisable(read) as (_, system, self.removed):
            kind, starts = _kind(system), _starts(system)
        try:
            if kind != self._kind or not self._moved(starts):
                self._load(read, kind)
        except (Fault, Interrupted):
            self._kind = None
            raise
        self._starts = starts

    def _load(self, read: Scene, kind: Hashable) -> None:
        self._open.close()
        self._place, self._hand = self._open.enter_context(in_own_hand(read))
        self._kind = kind
        self.loads += 1

    def _moved(self, starts: Starts) -> bool:
        """Sets the parameters that differ; False where that takes another FMU, or ends at no
        equilibrium nearby."""
        if starts.keys() != self._starts.keys():
            return False
        changed = [(k, v) for k, v in starts.items() if v[1] != self._starts[k][1]]
        if any(v[0].causality != "parameter" or v[0].variability != "tunable" for _, v in changed):
            return False
        if self._hand and any(fmu == HAND for (fmu, _), _ in changed):
            return False
        try:
            self._place.change([(fmu, scalar, value) for (fmu, _), (scalar, value) in changed])
        except (InputFault, FmuFault):
            return False
        return True


def _kind(system: System) -> Hashable:
    """What two systems share whose parameters alone differ."""
    time = system.timeline
    paces = tuple((c.name, c.first, c.longest, c.shortest, len(c.starts)) for c in time.clocks)
    fmus = tuple((f.name, f.description.guid, f.clock) for f in system.fmus)
    return time.base, paces, fmus, tuple(map(repr, system.connections)), system.coupling.scheme


def _starts(system: System) -> Starts:
    return {
        (f.name, scalar.name): (scalar, value)
        for f in system.fmus
        for scalar, value in f.starts
        if not isinstance(value, str)
    }
