"""Passive hold: zero-order, and a friction that keeps the energy it makes from being positive.

F_held = F_n - beta sign(d) c, by axis, at every step of the target, with d its displacement over
the step as it is foreseen, v T + dv T/2 (v its velocity, dv what it gained in the last step):

c = max(0, r + P/D),    P = made + r |x - x(t_n)|,    D = |d| + |v| T where P <= 0, |d| where P > 0

made is the hold's energy (`account`), r the most by which the mean of the source between two
bookings ever left the force that was held: the passivity observer. P is then the most that may
turn out to have been made, and the controller, in series as that of Hannaford & Ryu (IEEE Trans.
Robotics and Automation 18, 2002), keeps a reserve r D for the worst that the source may do over
the next step. c is at most the larger of r and the last two samples.

Theorem. Let the displacement dx of each step go the way foreseen, |dx| <= D (so that beta = 1), and
let the mean of the source leave F_n by at most r from t_n until the next sample is known. Then what
is really made, m, is at most P, and a step adds at most (r - c) |dx|: where P <= 0,
m' <= P + (r - c) |dx| <= 0; where P > 0, c >= r and m' <= m. Nothing is ever made. A larger swing
than ever, R > r, makes at most (R - r) W until it is known, W the way from a stamp until then, so
that m <= R W at any time. Each step outside the premises makes at most (R + C) |dx| on top, C the
largest c.

With a latency the premises reach over it: |x - x(t_n)| is then the whole way since t_n, as several
samples may be under way, and W grows with it. What a sample that is lost or overtaken did nobody
knows at the target: the theorem has none of those.

No hold can do without such premises. made' - made = (F_held - mean) dx, and mean and dx come after
F_held is chosen: whichever it is, even 0, one of mean = F_n +- r with one of dx = +-d makes r d or
more, at every step. Where a step goes against what was foreseen, beta is halved (a friction that
turns the target round is too large), and grows by a tenth a step after that.
"""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.energy_account import Account, Vector


class Passive(Account):
    def __init__(self, context: HoldContext) -> None:
        super().__init__(context)
        self.beta = np.ones(context.size)
        self._foreseen = np.zeros(context.size)

    def correction(self, fresh: bool) -> Vector:
        turned = self.motion * self._foreseen < 0.0
        self.beta = np.where(turned, self.beta / 2, np.minimum(1.1 * self.beta, 1.0))
        self._foreseen = self.ahead
        most = self.made + self.swing * self.travelled
        way = np.abs(self.ahead) + np.where(most > 0.0, 0.0, np.abs(self.straight))
        share = np.zeros_like(way)
        np.divide(most, way, out=share, where=way > 0.0)
        friction = np.clip(self.swing + share, 0.0, np.maximum(self.swing, self.largest))
        return -np.sign(self.ahead) * self.beta * friction
