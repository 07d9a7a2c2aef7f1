/* The hold `pspm` and the energy tank of the spring-damper that it sets.
 *
 * Passive set-position modulation (Lee & Huang, IEEE Trans. Robotics 26(4), 2010), with one energy
 * tank for both sides of the coupling.
 *
 * Where held samples are the set position y (and set velocity w) of a spring-damper at the haptic
 * rate,
 *
 * F = K (y - x) + B (w - v),    x the near end, v its velocity,
 *
 * each new sample switches the energy of the spring. This hold modulates the set position so that the
 * switch costs no more than the available energy. At a tick t_k, with e = y - x(t_k),
 *
 * output:  x(t_k) + s e and s w,    s = min(1, sqrt(A_k / N)),    N = 1/2 e'Ke + T/4 w'Bw    (*)
 *
 * s = 0 where A_k <= 0. A_k is the energy available: what the coupling has been given, less what it
 * has returned, on both sides. It starts with the spring's, V_0 = 1/2 e_0'K e_0.
 *
 * Near side. A sampled F_k = s K e + B (s w - v) acts over a step dx of T_k <= T, and takes its work:
 *
 * A_{k+1} = A_k - F_k.dx
 *
 * With V the spring's energy at the set position of t_k, and that of (*) at most A_k,
 *
 * F_k.dx = V(x_k) - V(x_{k+1}) + s w'B dx - dx'B dx/T_k + sigma_k <= N - V(x_{k+1}) + sigma_k
 * sigma_k = 1/2 dx'K dx + (dx/T_k - v)'B dx
 *
 * so that A_{k+1} >= V(x_{k+1}) - sigma_k: one step's sampling may overdraw it, by the surplus of
 * spring (Colgate & Schenkel 1997) and damper. The next s is then 0 and F = -B v, which fills it
 * again, unless the motion turns within a step: for any samples and motion, A >= -S, S the largest
 * sigma_k plus the B |v| |dx| of overdrawn steps that go against the velocity at their start. Where F
 * acts continuously (the spring is within a plant), sigma = 0, and A grows over a step by a lower
 * bound of what the motion puts in, V(x_{k+1}) - V(x_k) + dx'B dx/T_k - s w'B dx (Cauchy-Schwarz).
 *
 * Far side, where the force goes back to the body that sets the far end, under a hold that observes
 * its work (energy_account.c). Over its step the body has the predicted displacement d, at most D in
 * size, and the effort e is held, by axis with the sign by which e d is work on the body:
 *
 * - Where the modulation withholds a force that brakes the body, e d < 0, the far side gets it
 *   nevertheless: there it puts energy in, by which the near side gets its force a step later.
 * - Where e d > 0 the coupling drives it: e is scaled so that R = sum e D <= A - N, and R is set
 *   aside, A <- A - R.
 *
 * Each sample of the set position carries what the body has put in since the start, - sum e.dx, and
 * the R of all steps that have ended; when it arrives, the increase is credited to A. So a lost sample
 * costs nothing but time, and what `passive` takes out beside F is credited as well.
 *
 * Theorem. Let the body's displacement in each step be at most D where it is driven, and not against d
 * where it is braked. Then R - e.dx >= 0 is what a sample returns, and the net energy that the
 * coupling has given to both sides is at most V_0 - A <= V_0 + S, at every tick, for any motion of the
 * near end, any samples, latencies and losses of them. Each other step of the body gives at most
 * sum |e| |dx| in addition, and that is paid back first: while A <= 0 nothing is driven, and s = 0.
 *
 * On positions that are measured, x = x_true - delta, A counts F.dx of the measured ones. The work on
 * the true ones differs by F.delta at the ends and by at most sum |F_k - F_{k-1}| |delta_k|, with
 * |delta| up to an encoder's count: the account of quantisation, which no hold can see.
 *
 * The near end may be a wrapped angle: x is unwrapped, and the output is given on the turn that the
 * near end is read on.
 *
 * Of the vectors of a Tank, row 0 is of the set position and row 1 of the set velocity: `newest`, the newest
 * samples, and `modulated`, what applies from `tick` on. available is A (J), needed what of it the near side
 * may take until its next tick, withheld the part of F that the modulation took away. */

#include "loop.h"
#include "hold_table.h"

#include <math.h>
#include <string.h>

/* Takes note of the energy (J) that the far side has put in since the start. */
static void credit(Tank *t, double total) {
    t->available += total - t->credited;
    t->credited = total;
}

/* The energy (J) that the near side has put in over the last step; a lower bound of it where F acts
 * continuously: V(x) - V(x_k) without the difference of two squares. */
static double put_in(const Tank *t, double over) {
    const double *w = t->modulated + t->n;
    double work = 0.0, spring = 0.0, damper = 0.0;
    for (int64_t k = 0; k < t->n; k++) {
        const double moved = t->moved[k];
        work += t->force[k] * moved;
        spring += moved * (t->stiffness[k] * moved / 2 - t->force[k]);
        damper += t->damping[k] * moved * (moved / over - w[k]);
    }
    return t->sampled ? -work : spring + damper;
}

/* Sets what applies from `tick` on, beside the near end as it is read, once at each tick. */
static void modulate(Tank *t, const Loop *l, int64_t tick) {
    if (tick <= t->tick) return;
    const double *y = t->newest, *w = t->newest + t->n;
    const double over = (double)(tick - t->tick) * l->numerator / l->denominator;
    double stored = 0.0, moving = 0.0;
    for (int64_t k = 0; k < t->n; k++) {
        const double read = l->values[t->where[k]], last = t->tick < 0 ? y[k] : t->x[k];
        const double turn = t->turns[k], x = turn > 0.0 ? read + turn * rint((last - read) / turn) : read;
        const double error = y[k] - x;
        t->moved[k] = t->tick < 0 ? 0.0 : x - t->x[k];
        t->x[k] = x;
        stored += t->stiffness[k] * (error * error);
        moving += t->damping[k] * (w[k] * w[k]);
    }
    stored /= 2;
    t->available += t->tick < 0 ? stored : put_in(t, over);
    if (t->available < *t->least) *t->least = t->available;
    const double needed = stored + t->period / 4 * moving;
    const double left = 0.0 > t->available ? 0.0 : t->available;
    const double share = needed <= left ? 1.0 : sqrt(left / needed);
    for (int64_t k = 0; k < t->n; k++) {
        const double read = l->values[t->where[k]], error = y[k] - t->x[k];
        const double full = t->stiffness[k] * error + t->damping[k] * w[k];
        const double v = t->velocity ? l->values[t->velocity[k]] : t->moved[k] / over;
        t->modulated[k] = share == 1.0 ? y[k] + (read - t->x[k]) : read + share * error;
        t->modulated[t->n + k] = share * w[k];
        t->force[k] = t->sampled ? share * full - t->damping[k] * v : t->stiffness[k] * (share * error);
        t->withheld[k] = (1.0 - share) * full;
    }
    t->needed = share * share * needed;
    t->tick = tick;
}

/* Changes `effort` to what the far side gets over its next step, and returns the energy (J) set aside for
 * it. predicted, steady: its displacement, of which |predicted| + |steady| is the bound D; beta: trust. */
double tank_share(
    Tank *t, double *effort, const double *predicted, const double *steady, const double *beta
) {
    double wanted = 0.0;
    for (int64_t k = 0; k < t->n; k++) {
        const double withheld = beta[k] * t->withheld[k];
        if (withheld * predicted[k] < 0.0) effort[k] += withheld;
        if (effort[k] * predicted[k] > 0.0)
            wanted += fabs(effort[k]) * (fabs(predicted[k]) + fabs(steady[k]));
    }
    const double left = t->available - t->needed, room = 0.0 > left ? 0.0 : left;
    if (wanted > room) {
        for (int64_t k = 0; k < t->n; k++)
            if (effort[k] * predicted[k] > 0.0) effort[k] *= room / wanted;
        wanted = room;
    }
    t->available -= wanted;
    return wanted;
}

/* A sample may be followed by the energy (J) that the far side has put in by then. */
int push_set_position(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    (void)stamp, (void)arrival;
    memcpy(h->tank->newest + h->row * h->n, y, h->n * sizeof *y);
    if (h->width > h->n) credit(h->tank, y[h->n]);
    return 0;
}

int value_set_position(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    (void)ahead;
    modulate(h->tank, l, tick);
    memcpy(value, h->tank->modulated + h->row * h->n, h->n * sizeof *value);
    return 0;
}
