"""Passive hold: a zero-order hold with a friction that keeps the energy it generates at or below 0.

F_held = F_n - beta sign(d) c, by axis, at every step of the target, with d its predicted
displacement over the step, v T + dv T/2 (v its velocity, dv the change of v over the last step):

c = max(0, r + P/D),    P = E + r |x - x(t_n)|,    D = |d| + |v| T where P <= 0, |d| where P > 0

The passivity observer gives E, the energy generated (`energy_account`), and r, the running maximum
of the difference between the source's mean between two stamps and the force held meanwhile. P is
thus an upper bound of the energy generated once the samples to come are known. The series
passivity controller after Hannaford & Ryu (IEEE Trans. Robotics and Automation 18, 2002) keeps a
reserve r D for the worst case of the next step. c is at most the larger of r and the last two
samples.

Theorem. Let the displacement dx of each step have the predicted sign and |dx| <= D (so that
beta = 1), and let the mean of the source from t_n until the next sample is known differ from F_n by
at most r. Then the energy really generated, m, is at most P, and a step adds at most (r - c) |dx|:
where P <= 0, m' <= P + (r - c) |dx| <= 0; where P > 0, c >= r and m' <= m. So m <= 0 throughout. A
difference R larger than the r so far generates at most (R - r) W until it is known, W the distance
from a stamp until then, so that m <= R W at any time. Each step outside the premises generates at
most (R + C) |dx| in addition, C the largest c, and each other one while beta < 1 at most
(1 - beta) C |dx|, since m' <= m + (r - beta c) |dx|.

With a latency the premises extend over it: |x - x(t_n)| is then the path length since t_n, as
several samples may be in transit, and W grows with it. The theorem does not cover lost or overtaken
samples, whose effect the target cannot know.

No hold is passive without such premises. m' - m = (F_held - mean) dx, and mean and dx are only
determined after F_held is chosen: for any choice, even 0, one of mean = F_n +- r with one of
dx = +-d generates r d or more, at every step. Where a step goes back by more than a hundredth of
the prediction, beta is halved (a friction that reverses the target is too large); after that it
grows by a tenth a step. A smaller step back has been stopped, as a friction may, and leaves beta.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.energy_account import Account, Vector
from hapticlink.orchestrator.holds.hold import HoldContext

STOPPED = 0.01
"""A step back by less than this part of the predicted displacement counts as none: a friction that
just stops the target is not too large."""


class Passive(Account):
    def __init__(self, context: HoldContext) -> None:
        super().__init__(context)
        self._last_predicted = np.zeros(context.size)

    def outside(self, furthest: Vector, added: Vector) -> tuple[NDArray[np.bool_], Vector]:
        """(r + c) |dx| of a step that is not as predicted, (1 - beta) C |dx| of any other."""
        way = np.abs(self.motion)
        beyond = (self.motion * self.predicted < 0.0) | (way > furthest)
        ones = np.ones_like(self.beta)  # without friction, as a linearisation has it, beta is 0
        left_out = np.divide(1.0, self.beta, out=ones, where=self.beta > 0.0) - 1.0
        return beyond, np.where(beyond, self.swing + added, left_out * added) * way

    def correction(self, fresh: bool) -> Vector:
        ahead = self._last_predicted
        reversed_ = self.motion * ahead < -STOPPED * (ahead * ahead)
        self.beta = np.where(reversed_, self.beta / 2, np.minimum(1.1 * self.beta, 1.0))
        self._last_predicted = self.predicted
        bound = self.generated + self.swing * self.travelled  # P
        d = np.abs(self.predicted)
        distance = d + np.where(bound > 0.0, 0.0, np.abs(self.predicted_steady))  # D
        share = np.zeros_like(distance)
        np.divide(bound, distance, out=share, where=distance > 0.0)
        friction = np.clip(self.swing + share, 0.0, np.maximum(self.swing, self.largest))
        return -np.sign(self.predicted) * self.beta * friction
