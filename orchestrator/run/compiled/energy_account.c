/* The holds `passive` and `nepce`: a zero-order hold plus a correction, evaluated once at each tick read,
 * and the passivity observer of both: the energy that a held effort generates.
 *
 * By axis, each held force F_held paired with the displacement dx of the step that it acts over:
 *
 * E(t) = sum F_held dx - sum (F_{k-1} + F_k)/2 (x(t_k) - x(t_{k-1})) - F_n (x(t) - x(t_n))
 *
 * The ideal force is taken as linear in the displacement between samples (exact for a spring) and,
 * after the newest sample t_n, as F_n, since later samples are not known yet. A delayed sample is
 * paired with the target's position at its stamp, interpolated linearly between the target's steps.
 * Up to t_n this equals what meters.c measures, except for samples that are lost or
 * overtaken, which the target never sees.
 *
 * By axis: motion, the displacement of the last step; steady and predicted, that of the coming step at
 * the target's present velocity, and with the acceleration of the last step as well (m, rad); largest,
 * the larger magnitude of the last two samples; swing, the running maximum of the difference between the
 * source's mean over an interval between stamps and a sample held during it (N, N.m); beta, the trust in
 * the prediction; travelled, the displacement of the last period. premises: the steps by entry so far,
 * how many of them were outside the premises of the hold, or of its tank, and the energy (J) that such
 * steps can have generated beyond what is proved. */

#include "loop.h"
#include "hold_table.h"

#include <math.h>
#include <string.h>

/* The larger of two as NumPy has it: the first where they are equal, NaN where one is. */
static double larger(double a, double b) { return a >= b || isnan(a) ? a : b; }

static void queue(Queue *q, int64_t n, int64_t tick, const double *values) {
    q->ticks[q->count] = tick;
    memcpy(q->values + q->count++ * n, values, n * sizeof *values);
}

static void drop(Queue *q, int64_t n, int64_t first) {
    q->count -= first;
    memmove(q->ticks, q->ticks + first, q->count * sizeof *q->ticks);
    memmove(q->values, q->values + first * n, q->count * n * sizeof *q->values);
}

int account_has_room(const Account *a, int64_t samples) {
    return a->path.count < a->room && a->until.count < a->room && a->fresh.count + samples <= a->room;
}

int push_account(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    queue(&h->account->fresh, h->n, stamp, y);
    h->account->delayed = arrival > stamp;
    return 0;
}

/* The target's position at `stamp`, interpolated linearly between its steps; drops the path before it,
 * since stamps never decrease. */
static void position_at(Account *a, int64_t stamp, double *x) {
    const Queue *p = &a->path;
    int64_t passed = 0;
    while (passed + 1 < p->count && p->ticks[passed + 1] <= stamp) passed++;
    if (passed) drop(&a->path, a->n, passed);
    const int64_t last = p->count > 1, tick = p->ticks[0], later = p->ticks[last];
    const double share = (double)(stamp - tick) / (double)(later - tick);
    for (int64_t k = 0; k < a->n; k++) {
        const double from = p->values[k], to = p->values[last * a->n + k];
        x[k] = stamp <= tick || later == tick ? from : from + (to - from) * share;
    }
}

/* Adds the ideal work up to a new sample. */
static void book(Account *a, int64_t stamp, const double *y) {
    double *sample = a->sample, *x_stamp = a->x_stamp, *there = a->at_stamp;
    position_at(a, stamp, there);
    for (int64_t k = 0; k < a->n; k++) {
        const double middle = (sample[k] + y[k]) / 2;
        a->ideal[k] += middle * (there[k] - x_stamp[k]);
        a->largest[k] = larger(fabs(y[k]), fabs(sample[k]));
        a->average[k] += middle * (double)(stamp - a->stamp);
        x_stamp[k] = there[k];
        sample[k] = y[k];
    }
    a->stamp = stamp;
}

/* Counts the entries of the step that has ended, and what is at stake in it: with a tank the work beyond
 * what was set aside for it; of `passive` (r + c) |dx| of a step that is not as predicted, (1 - beta) C |dx|
 * of any other; of `nepce` that of a step against the motion of the last period, in which the correction
 * does the opposite work. */
static void watch(Account *a) {
    for (int64_t k = 0; k < a->n; k++) {
        const double moved = a->motion[k], ahead = a->predicted[k];
        const double effort = a->held[k], added = fabs(effort - a->sample[k]);
        const double furthest = fabs(ahead) + fabs(a->steady[k]), way = fabs(moved);
        double stake = 0.0;
        int outside;
        if (a->tank) {
            stake = effort * moved - (effort * ahead > 0.0 ? fabs(effort) * furthest : 0.0);
            outside = stake > 0.0;
            if (!outside) stake = 0.0;
        } else if (a->passive) {
            /* Without friction, as a linearisation has it, beta is 0. */
            const double left_out = a->beta[k] > 0.0 ? 1.0 / a->beta[k] - 1.0 : 0.0;
            outside = moved * ahead < 0.0 || way > furthest;
            stake = (outside ? a->swing[k] + added : left_out * added) * way;
        } else {
            outside = moved * a->travelled[k] < 0.0 && added > 0.0;
            stake = outside ? added * way : 0.0;
        }
        a->premises[0] += 1.0;
        a->premises[1] += outside;
        a->premises[2] += stake;
    }
}

/* Adds the held work since the last tick, and the ideal work up to each new stamp. */
static void account(Account *a, const Loop *l, int64_t tick) {
    const int64_t n = a->n;
    const size_t bytes = n * sizeof(double);
    double *x = a->now, *before = a->x, *mean = a->average;
    read_all(&a->displacement, l->values, x);
    if (a->tick < 0) {
        memcpy(before, x, bytes);
        memcpy(a->x_stamp, x, bytes);
        a->stamp = a->fresh.ticks[0];
        memcpy(a->sample, a->fresh.values, bytes);
        a->tick = tick;
        if (a->velocity.n) read_all(&a->velocity, l->values, a->v);
    }
    for (int64_t k = 0; k < n; k++) {
        a->motion[k] = x[k] - before[k];
        a->work[k] += a->held[k] * a->motion[k];
        mean[k] = 0.0;
    }
    a->steps = tick - a->tick;
    if (a->steps) watch(a);
    const int64_t passed = a->stamp;
    if (!a->path.count || tick > a->path.ticks[a->path.count - 1]) queue(&a->path, n, tick, x);
    if (a->fresh.count) queue(&a->until, n, tick, a->sample);
    for (int64_t i = 0; i < a->fresh.count; i++) book(a, a->fresh.ticks[i], a->fresh.values + i * n);
    if (a->stamp > passed) {
        Queue *u = &a->until;
        for (int64_t k = 0; k < n; k++) {
            mean[k] /= (double)(a->stamp - passed);
            for (int64_t i = 0; i < u->count; i++)
                a->swing[k] = larger(a->swing[k], fabs(mean[k] - u->values[i * n + k]));
        }
        int64_t known = 0;
        while (known < u->count && (u->ticks[known] <= a->stamp || !a->delayed)) known++;
        drop(u, n, known);
    }
    a->fresh.count = 0;
    a->tick = tick;
    memcpy(before, x, bytes);
}

/* The displacement of the coming step, of `step` ticks or the length of the last one if that is longer.
 * Without a velocity output, the last displacement is repeated. */
static void predict(Account *a, const Loop *l, double step) {
    if (!a->velocity.n) {
        memcpy(a->steady, a->motion, a->n * sizeof(double));
        memcpy(a->predicted, a->motion, a->n * sizeof(double));
        return;
    }
    double *v = a->now;
    read_all(&a->velocity, l->values, v);
    if ((double)a->steps > step) step = (double)a->steps;
    const double seconds = step * l->numerator / l->denominator;
    for (int64_t k = 0; k < a->n; k++) {
        if (a->steps) a->gain[k] = (v[k] - a->v[k]) / (double)a->steps;
        a->v[k] = v[k];
        a->steady[k] = v[k] * seconds;
        a->predicted[k] = a->steady[k] + a->gain[k] * (step / 2 * seconds);
    }
}

/* The energy (J) that the far side has put in until now, with what was set aside for it. */
EXPORT double hapticlink_credit(const Account *a, const Loop *l) {
    double *x = a->now, work = 0.0;
    read_all(&a->displacement, l->values, x);
    for (int64_t k = 0; k < a->n; k++)
        work += a->work[k] + a->held[k] * (x[k] - a->x[k]);
    return a->promised - work;
}

/* Limits the held effort to the energy available in the tank, and sets that aside. */
static void share(Account *a, int64_t tick) {
    if (a->since == tick) {
        a->tank->available += a->promise;
        a->promised -= a->promise;
    }
    a->promise = tank_share(
        a->tank, a->held, a->predicted, a->steady,
        a->beta
    );
    a->promised += a->promise;
    a->since = tick;
}

static double generated(const Account *a, int64_t k) {
    const double moved = a->x[k] - a->x_stamp[k];
    return a->work[k] - a->ideal[k] - a->sample[k] * moved;
}

/* Distance since the stamp of the newest sample: |x - x(t_n)|, or, where samples are delayed and several
 * may be in transit, the length of the path. */
static double travelled(const Account *a, int64_t k) {
    double from = a->x_stamp[k], length = 0.0;
    if (!a->delayed) return fabs(a->x[k] - from);
    for (int64_t i = 0; i < a->path.count; i++) {
        if (a->path.ticks[i] <= a->stamp) continue;
        length += fabs(a->path.values[i * a->n + k] - from);
        from = a->path.values[i * a->n + k];
    }
    return length;
}

/* Passive hold: a zero-order hold with a friction that keeps the energy it generates at or below 0.
 *
 * F_held = F_n - beta sign(d) c, by axis, at every step of the target, with d its predicted
 * displacement over the step, v T + dv T/2 (v its velocity, dv the change of v over the last step):
 *
 * c = max(0, r + P/D),    P = E + r |x - x(t_n)|,    D = |d| + |v| T where P <= 0, |d| where P > 0
 *
 * The passivity observer gives E, the energy generated (above), and r, the running maximum
 * of the difference between the source's mean between two stamps and the force held meanwhile. P is
 * thus an upper bound of the energy generated once the samples to come are known. The series
 * passivity controller after Hannaford & Ryu (IEEE Trans. Robotics and Automation 18, 2002) keeps a
 * reserve r D for the worst case of the next step. c is at most the larger of r and the last two
 * samples.
 *
 * Theorem. Let the displacement dx of each step have the predicted sign and |dx| <= D (so that
 * beta = 1), and let the mean of the source from t_n until the next sample is known differ from F_n by
 * at most r. Then the energy really generated, m, is at most P, and a step adds at most (r - c) |dx|:
 * where P <= 0, m' <= P + (r - c) |dx| <= 0; where P > 0, c >= r and m' <= m. So m <= 0 throughout. A
 * difference R larger than the r so far generates at most (R - r) W until it is known, W the distance
 * from a stamp until then, so that m <= R W at any time. Each step outside the premises generates at
 * most (R + C) |dx| in addition, C the largest c, and each other one while beta < 1 at most
 * (1 - beta) C |dx|, since m' <= m + (r - beta c) |dx|.
 *
 * With a latency the premises extend over it: |x - x(t_n)| is then the path length since t_n, as
 * several samples may be in transit, and W grows with it. The theorem does not cover lost or overtaken
 * samples, whose effect the target cannot know.
 *
 * No hold is passive without such premises. m' - m = (F_held - mean) dx, and mean and dx are only
 * determined after F_held is chosen: for any choice, even 0, one of mean = F_n +- r with one of
 * dx = +-d generates r d or more, at every step. Where a step goes back by more than a hundredth of
 * the prediction, beta is halved (a friction that reverses the target is too large); after that it
 * grows by a tenth a step. A smaller step back has been stopped, as a friction may, and leaves beta. */

/* A step back by less than this part of the predicted displacement counts as none: a friction that
 * just stops the target is not too large. */
static const double STOPPED = 0.01;

/* -beta sign(d) c of entry k. */
static double friction(const Account *a, int64_t k) {
    double *beta = a->beta + k, *last = a->last + k;
    const double predicted = a->predicted[k], swing = a->swing[k];
    if (a->motion[k] * *last < -STOPPED * (*last * *last))
        *beta /= 2;
    else
        *beta = 1.1 * *beta > 1.0 ? 1.0 : 1.1 * *beta;
    *last = predicted;
    const double bound = generated(a, k) + swing * travelled(a, k);
    const double distance = fabs(predicted) + (bound > 0.0 ? 0.0 : fabs(a->steady[k]));
    const double size = swing + (distance > 0.0 ? bound / distance : 0.0);
    const double most = larger(swing, a->largest[k]);
    const double sign = predicted > 0.0 ? 1.0 : predicted < 0.0 ? -1.0 : predicted == 0.0 ? 0.0 : predicted;
    return -sign * *beta * (size < 0.0 ? 0.0 : size > most ? most : size);
}

/* Nearly energy-preserving hold: a zero-order hold that returns the energy error accumulated so
 * far, of either sign, over the next period.
 *
 * F_held = F_n - E/D by axis, with E the energy generated (above) and D the displacement
 * over the last period; the correction is limited to the larger magnitude of the last two samples.
 * On a steady motion it is the half-step lead, F_n + (F_n - F_{n-1})/2. After the nearly
 * energy-preserving coupling element of Benedikt, Watzenig, Zehetner & Hofer (5th Int. Conf. on
 * Computational Methods for Coupled Problems, 2013). */

/* The effort that does the work -E over that displacement; 0 where the target does not move. */
static double repayment(const Account *a, int64_t k) {
    double *last = a->last + k;
    const double moved = a->x[k] - *last, most = a->largest[k];
    *last = a->x[k];
    a->travelled[k] = moved;
    const double effort = moved != 0.0 ? -generated(a, k) / moved : 0.0;
    return effort < -most ? -most : effort > most ? most : effort;
}

static int value(Account *a, const Loop *l, int64_t tick, double ahead, double *value) {
    if (tick > a->tick || a->fresh.count) {
        const int fresh = a->fresh.count > 0;
        account(a, l, tick);
        predict(a, l, 2 * ahead);
        for (int64_t k = 0; k < a->n; k++) {
            if (a->passive || fresh) a->correction[k] = a->passive ? friction(a, k) : repayment(a, k);
            a->held[k] = a->sample[k] + a->correction[k];
        }
        if (a->tank) share(a, tick);
    }
    memcpy(value, a->held, a->n * sizeof *value);
    return 0;
}

int value_passive(Hold *h, const Loop *l, int64_t tick, double ahead, double *into) {
    return value(h->account, l, tick, ahead, into);
}

int value_nearly_energy_preserving(Hold *h, const Loop *l, int64_t tick, double ahead, double *into) {
    return value(h->account, l, tick, ahead, into);
}
