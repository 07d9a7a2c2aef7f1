"""Passive set-position modulation (Lee & Huang, IEEE Trans. Robotics 26(4), 2010), with one energy
tank for both sides of the coupling.

Where held samples are the set position y (and set velocity w) of a spring-damper at the haptic
rate,

F = K (y - x) + B (w - v),    x the near end, v its velocity,

each new sample switches the energy of the spring. This hold modulates the set position so that the
switch costs no more than the available energy. At a tick t_k, with e = y - x(t_k),

output:  x(t_k) + s e and s w,    s = min(1, sqrt(A_k / N)),    N = 1/2 e'Ke + T/4 w'Bw    (*)

s = 0 where A_k <= 0. A_k is the energy available: what the coupling has been given, less what it
has returned, on both sides. It starts with the spring's, V_0 = 1/2 e_0'K e_0.

Near side. A sampled F_k = s K e + B (s w - v) acts over a step dx of T_k <= T, and takes its work:

A_{k+1} = A_k - F_k.dx

With V the spring's energy at the set position of t_k, and that of (*) at most A_k,

F_k.dx = V(x_k) - V(x_{k+1}) + s w'B dx - dx'B dx/T_k + sigma_k <= N - V(x_{k+1}) + sigma_k
sigma_k = 1/2 dx'K dx + (dx/T_k - v)'B dx

so that A_{k+1} >= V(x_{k+1}) - sigma_k: one step's sampling may overdraw it, by the surplus of
spring (Colgate & Schenkel 1997) and damper. The next s is then 0 and F = -B v, which fills it
again, unless the motion turns within a step: for any samples and motion, A >= -S, S the largest
sigma_k plus the B |v| |dx| of overdrawn steps that go against the velocity at their start. Where F
acts continuously (the spring is within a plant), sigma = 0, and A grows over a step by a lower
bound of what the motion puts in, V(x_{k+1}) - V(x_k) + dx'B dx/T_k - s w'B dx (Cauchy-Schwarz).

Far side, where the force goes back to the body that sets the far end, under a hold that observes
its work (`energy_account`). Over its step the body has the predicted displacement d, at most D in
size, and the effort e is held, by axis with the sign by which e d is work on the body:

- Where the modulation withholds a force that brakes the body, e d < 0, the far side gets it
  nevertheless: there it puts energy in, by which the near side gets its force a step later.
- Where e d > 0 the coupling drives it: e is scaled so that R = sum e D <= A - N, and R is set
  aside, A <- A - R.

Each sample of the set position carries what the body has put in since the start, - sum e.dx, and
the R of all steps that have ended; when it arrives, the increase is credited to A. So a lost sample
costs nothing but time, and what `passive` takes out beside F is credited as well.

Theorem. Let the body's displacement in each step be at most D where it is driven, and not against d
where it is braked. Then R - e.dx >= 0 is what a sample returns, and the net energy that the
coupling has given to both sides is at most V_0 - A <= V_0 + S, at every tick, for any motion of the
near end, any samples, latencies and losses of them. Each other step of the body gives at most
sum |e| |dx| in addition, and that is paid back first: while A <= 0 nothing is driven, and s = 0.

On positions that are measured, x = x_true - delta, A counts F.dx of the measured ones. The work on
the true ones differs by F.delta at the ends and by at most sum |F_k - F_{k-1}| |delta_k|, with
|delta| up to an encoder's count: the account of quantisation, which no hold can see.

The near end may be a wrapped angle: x is unwrapped, and the output is given on the turn that the
near end is read on.
"""

from __future__ import annotations

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.hold import Hold, HoldContext


class PassiveSetPosition(Hold):
    needs = "spring"

    def __init__(self, context: HoldContext) -> None:
        assert context.tank is not None
        self.tank, self.row = context.tank

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        """`sample` may be followed by the energy (J) that the far side has put in by then."""
        size = self.tank.newest.shape[1]
        self.tank.newest[self.row] = sample[:size]
        if len(sample) > size:
            self.tank.credit(float(sample[size]))

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self.tank.modulated(tick)[self.row]
