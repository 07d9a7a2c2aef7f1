"""Defaults of the virtual mechanism that depend on step sizes, as expressions of the parameters
`step_size` and `frame_size`: Baumgarte's alpha (integrators/base.py), and the scales of friction
(friction_scale.py, and tau of forces/friction.py for contacts)."""

from __future__ import annotations

import math

from hapticlink.components.component import Signals, Variable
from hapticlink.components.contact import contact_forces
from hapticlink.components.dynamics import friction_scale
from hapticlink.components.integrators import METHODS, base
from hapticlink.components.ports import FRAME_SIZE, STEP_SIZE
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage, Mechanism

NOMINAL = 1 / 512  # s


class StepDefaults:
    """parameters: the step sizes, as far as defaults depend on them. They start at step_s and
    frame_s (s); without step_s, at a size that suits the equations. baumgarte: the default gains.

    Raises ValueError for friction that is too stiff for step_s.
    """

    def __init__(
        self,
        linkage: Linkage,
        mechanism: Mechanism,
        contacts: Contacts | None,
        step_s: float | None,
        frame_s: float | None,
    ) -> None:
        self._contacts, self._substeps = contacts, mechanism.substeps
        self._scales, longest = friction_scale.scales(linkage), math.inf
        method = METHODS[mechanism.integrator]
        if not method.l_stable:
            if step_s is not None:
                friction_scale.require_slow(self._scales, step_s / mechanism.substeps)
            longest = friction_scale.longest_step(self._scales) * mechanism.substeps
        start = min(NOMINAL, longest) if step_s is None else step_s
        bound = longest if math.isfinite(longest) else None
        self.baumgarte = base.HELD_MODEL if frame_s else method.baumgarte
        stabilised = mechanism.stabilization == "baumgarte" and linkage.closed
        self._alpha = stabilised and mechanism.alpha is None
        self._held = bool(self._alpha and frame_s)
        rubs = self._scales or (contacts and contacts.friction is not None)
        self.parameters: list[Variable] = []
        if rubs or (self._alpha and not self._held):
            text = "communication step size"
            self.parameters.append(Variable(STEP_SIZE, (), "s", start, text, "fixed", max=bound))
        if self._held:
            text = "step size of the graphics copy"
            self.parameters.append(Variable(FRAME_SIZE, (), "s", frame_s or 0.0, text, "fixed"))

    @property
    def alpha_text(self) -> str:
        """By which default alpha comes about, for the schematic; "" where there is none."""
        period = "frame" if self._held else "step"
        text = rf"$\alpha$ = {self.baumgarte.alpha_T:g} / {period}"
        return text if self._alpha else ""

    def define(self, p: Signals) -> None:
        """Gives each default its name among the parameters p."""
        if STEP_SIZE in p:
            h = p[STEP_SIZE] / self._substeps
            for scale in self._scales:
                for name, value in scale.defaults(h).items():
                    p.define(name, value)
            if self._contacts and self._contacts.friction is not None:
                p.define("tau_contact", contact_forces.lag(h))
        if self._alpha:
            p.define("alpha", self.baumgarte.alpha_T / (p[FRAME_SIZE] if self._held else h))
