/* The energy tank of a spring-damper: energy_tank.py, operation by operation. */

#include "loop.h"

#include <math.h>
#include <string.h>

void tank_credit(Tank *t, double total) {
    t->available += total - t->credited;
    t->credited = total;
}

/* EnergyTank._put_in */
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

void tank_modulate(Tank *t, const Loop *l, int64_t tick) {
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

/* EnergyTank.shared: `effort` is changed in place; furthest is |predicted| + |steady|. */
double tank_share(
    Tank *t, double *effort, const double *predicted, const double *steady, const double *beta
) {
    double wanted = 0.0;
    for (int64_t k = 0; k < t->n; k++) {
        const double withheld = (beta ? beta[k] : 1.0) * t->withheld[k];
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
