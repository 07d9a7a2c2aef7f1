"""A scene at its equilibrium in a pose, in a hand: its linearised period under changed gains and in
other hands, and its compliance with the hand cut off (port_response.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np

from hapticlink.analysis.search.settings import Gains, Scales
from hapticlink.analysis.stability.equilibrium import equilibrium
from hapticlink.analysis.stability.hand_slopes import hand_slopes
from hapticlink.analysis.stability.hands import spring_hand
from hapticlink.analysis.stability.lifted_map import LiftedMap, long_enough, open_lifted_map
from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.modes import DRIFT, Mode, kind, modes
from hapticlink.analysis.stability.port_response import hand_port, response
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.smooth_scene import StartPose, linearisable
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.arrays import Complex, Matrix, Vector
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.base.signal_names import CONTACT_GAP, ENVIRONMENT_WRENCH, HAND
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System

SOFT = 0.25
"""Scale of the scene's gains with which an equilibrium is searched where they throw the handle
off."""
SURE = 0.01
"""Uncertainty of an eigenvalue below which it may count as 1."""


def contact_force(linkage: Linkage, F_env: Matrix, gap: Vector | None) -> Matrix:
    """F_env (k, 3) where a body touches something, by the least `gap` (k,), 0 elsewhere: F_env has
    other hands and efforts on joints, too. All of it counts where a joint has limits, since nothing
    tells whether it is at one."""
    limited = any(j.limits for j in linkage.joint) or any(j.limits for j in linkage.loop)
    touches = np.zeros(len(F_env), bool) if gap is None else gap < 0.0
    return np.where((touches | limited)[:, None], F_env, 0.0)


def _is_felt(mode: Mode) -> bool:
    """Whether a mode that grows is more than a drift."""
    return kind(mode.growth, mode.omega / (2 * np.pi), DRIFT) != "drift"


class RestingScene:
    """A scene at its equilibrium in the hand that it has, searched from a `start`, such as the
    `equilibrium` of the same scene at other rates. T: the haptic period (s). gains: those of its
    laws, with which the map begins `scaled`. Raises InputFault where there is no equilibrium."""

    def __init__(
        self,
        map_: LiftedMap,
        gains: Gains,
        scene: Scene,
        start: Vector | None = None,
        scaled: float = 1.0,
    ) -> None:
        self.map, self.gains, self.T = map_, gains, float(1 / exact(scene.haptics.rate))
        self._linkage, self.space = scene.linkage, scene.space
        if start is None or len(start) != len(map_.start):  # holds keep more or fewer samples
            start = map_.start
        self._home = equilibrium(map_, start)
        own: Scales = {}
        self._known: tuple[Scales | None, LinearPeriod] = own, self._home
        if scaled != 1.0:
            self._known = None, self._home
            with suppress(InputFault, FmuFault):  # gains too stiff for an equilibrium
                self._home = self.period(own)

    @property
    def equilibrium(self) -> Vector:
        """The state at the equilibrium with the scene's gains, or with softer ones."""
        return self._home.point

    @property
    def contact(self) -> Vector:
        """The contact force (3,) at the `equilibrium`, 0 without contact."""
        return self._contact_at(self._home.point)

    def _contact_at(self, point: Vector) -> Vector:
        F, gap = (point[self._places(port)] for port in (ENVIRONMENT_WRENCH, CONTACT_GAP))
        if self._linkage is None or not len(F):
            return np.zeros(3)
        found: Vector = contact_force(self._linkage, F[None], gap if len(gap) else None)[0]
        return found

    def counts(self) -> tuple[Vector, Vector, Vector]:
        """The numbers of constrained directions at the `equilibrium`: as they are, the fewest and
        the most that there can be by what was before, for their hysteresis."""
        point, every = self.equilibrium, float(self.space.size)
        fewest, most = (self.map.counted(point, before) for before in (0.0, every))
        return point[self.map.counts], fewest, most

    def change(self, parameters: Sequence[tuple[str, Scalar, float]]) -> None:
        """Sets tunable parameters, by FMU, and moves to the equilibrium with them. Raises
        InputFault or FmuFault where there is none nearby."""
        self.map.set_parameters(parameters)
        self._home = equilibrium(self.map, self._home.point)
        self._known = {}, self._home

    def stable(self, scales: Scales, hand: float) -> bool:
        """Whether no mode grows, neutral ones and slow drift aside, with gains scaled by `scales`
        in a spring hand of the stiffness `hand` (N/m)."""
        try:
            slopes = hand_slopes(spring_hand(hand, self.space), self.T, self.space)
            period = self.period(scales).held({HAND: slopes})
            all_modes = modes(period.linear, self.map.period)
        except (FmuFault, InputFault):  # diverges at once
            return False
        # An error as large as z says nothing of z = 1.
        counted = [mode for mode in all_modes if not (mode.neutral and mode.uncertainty < SURE)]
        return bool(counted) and not any(
            mode.growth > 0.0 and _is_felt(period.traced(mode)) for mode in counted
        )

    def signal(self, port: str) -> Matrix:
        """The values of an output `fmu.port` at the `equilibrium`; none without such an output."""
        return self._home.point[self._places(port)]

    def _places(self, port: str) -> list[int]:
        return [
            i
            for i, c in enumerate(self.map.coordinates)
            if c.kind == "signal" and str(c).partition("[")[0] == port
        ]

    def compliance(self, scales: Scales, hertz: float) -> Complex:
        """The compliance (3, 3) of the handle at a frequency. Raises InputFault where it has no
        equilibrium with these gains."""
        try:
            period = self.period(scales)
        except FmuFault as fault:
            raise InputFault(str(fault)) from None
        return response(period, hand_port(self.map.system)).compliance(hertz, self.T)

    def period(self, scales: Scales) -> LinearPeriod:
        """The period at the equilibrium with these gains, searched from `equilibrium`, so that the
        result does not depend on what was asked before."""
        if scales != self._known[0]:
            self.map.set_parameters([*self.gains.parameters(scales)])
            period = equilibrium(self.map, self._home.point)
            if self.contact.any() and not self._contact_at(period.point).any():
                raise InputFault("it comes off what it touches")
            self._known = dict(scales), period
        return self._known[1]


@contextmanager
def resting(
    scene: str | Path | Scene,
    options: Options = (),
    start: Vector | None = None,
    at: StartPose | None = None,
    work: SharedWork | None = None,
) -> Iterator[RestingScene]:
    """A scene with `options` at its equilibrium next to its start, to the place `at` or to the
    state `start`, in the hand that it has; `work` as of `open_lifted_map`. Raises InputFault or
    FmuFault where it has none."""
    with (
        linearisable(scene, options, at) as (read, system, _),
        resting_system(read, system, start, work) as place,
    ):
        yield place


@contextmanager
def resting_system(
    read: Scene, system: System, start: Vector | None = None, work: SharedWork | None = None
) -> Iterator[RestingScene]:
    """`resting` of a system that is built."""
    with ExitStack() as stack:
        system = long_enough(read, system)
        gains = Gains(system, read.controllers)

        def rested(scale: float) -> RestingScene:
            softer = gains.applied(system, dict.fromkeys(gains.laws, scale))
            map_ = stack.enter_context(open_lifted_map(softer, read, work))
            return RestingScene(map_, gains, read, start, scale)

        try:
            place = rested(1.0)
        except (InputFault, FmuFault):
            if not gains.laws:
                raise
            place = rested(SOFT)
        yield place
