"""Passive hold: zero-order, and what energy it makes is taken back at once.

F_held = F_n - made/dx where made > 0, 0 elsewhere: a passivity observer on the hold's own energy
(`account`) and the series passivity controller of Hannaford & Ryu (IEEE Trans. Robotics and
Automation 18, 2002), at every step of the target, with dx its last displacement; by axis, and
never more than the larger of the last two samples. A force acts on the motion that follows, so
what a period makes is known at its end and repaid in the next: nothing builds up.
"""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.holds.account import Account, Vector, repayment


class Passive(Account):
    def correction(self, fresh: bool) -> Vector:
        return repayment(np.maximum(self.made, 0.0), self.motion, self.largest)
