/* The holds that observe the energy that they generate: energy_account.py, passive.py and
 * nearly_energy_preserving.py, operation by operation. */

#include "loop.h"

#include <math.h>
#include <string.h>

static double *vector(const Account *a, int64_t i) { return a->vectors + i * a->n; }

enum {
    SAMPLE_, HELD, X, X_STAMP, WORK, IDEAL, MOTION, STEADY, PREDICTED, V, GAIN, LARGEST, SWING, NOW,
    AVERAGE, AT_STAMP, BETA, LAST, TRAVELLED, /* BETA, of `passive`, is the correction of `nepce` */
};

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

void account_push(Account *a, const double *sample, int64_t stamp, int64_t arrival) {
    queue(&a->fresh, a->n, stamp, sample);
    a->delayed = arrival > stamp;
}

/* Account._position_at */
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

/* The part of Account._account for one new sample. */
static void book(Account *a, int64_t stamp, const double *y) {
    double *sample = vector(a, SAMPLE_), *x_stamp = vector(a, X_STAMP), *there = vector(a, AT_STAMP);
    position_at(a, stamp, there);
    for (int64_t k = 0; k < a->n; k++) {
        const double middle = (sample[k] + y[k]) / 2;
        vector(a, IDEAL)[k] += middle * (there[k] - x_stamp[k]);
        vector(a, LARGEST)[k] = larger(fabs(y[k]), fabs(sample[k]));
        vector(a, AVERAGE)[k] += middle * (double)(stamp - a->stamp);
        x_stamp[k] = there[k];
        sample[k] = y[k];
    }
    a->stamp = stamp;
}

/* Account._watch */
static void watch(Account *a) {
    for (int64_t k = 0; k < a->n; k++) {
        const double moved = vector(a, MOTION)[k], ahead = vector(a, PREDICTED)[k];
        const double effort = vector(a, HELD)[k], added = fabs(effort - vector(a, SAMPLE_)[k]);
        const double furthest = fabs(ahead) + fabs(vector(a, STEADY)[k]), way = fabs(moved);
        double stake = 0.0;
        int outside;
        if (a->tank) {
            stake = effort * moved - (effort * ahead > 0.0 ? fabs(effort) * furthest : 0.0);
            outside = stake > 0.0;
            if (!outside) stake = 0.0;
        } else if (a->passive) {
            outside = moved * ahead < 0.0 || way > furthest;
            stake = (outside ? vector(a, SWING)[k] + added : (1.0 / vector(a, BETA)[k] - 1.0) * added) * way;
        } else {
            outside = moved * vector(a, TRAVELLED)[k] < 0.0 && added > 0.0;
            stake = outside ? added * way : 0.0;
        }
        a->premises[0] += 1.0;
        a->premises[1] += outside;
        a->premises[2] += stake;
    }
}

static void account(Account *a, const Loop *l, int64_t tick) {
    const int64_t n = a->n;
    const size_t bytes = n * sizeof(double);
    double *x = vector(a, NOW), *before = vector(a, X), *mean = vector(a, AVERAGE);
    read_all(&a->displacement, l->values, x);
    if (a->tick < 0) {
        memcpy(before, x, bytes);
        memcpy(vector(a, X_STAMP), x, bytes);
        a->stamp = a->fresh.ticks[0];
        memcpy(vector(a, SAMPLE_), a->fresh.values, bytes);
        a->tick = tick;
        if (a->velocity.n) read_all(&a->velocity, l->values, vector(a, V));
    }
    for (int64_t k = 0; k < n; k++) {
        vector(a, MOTION)[k] = x[k] - before[k];
        vector(a, WORK)[k] += vector(a, HELD)[k] * vector(a, MOTION)[k];
        mean[k] = 0.0;
    }
    a->steps = tick - a->tick;
    if (a->steps) watch(a);
    const int64_t passed = a->stamp;
    if (!a->path.count || tick > a->path.ticks[a->path.count - 1]) queue(&a->path, n, tick, x);
    if (a->fresh.count) queue(&a->until, n, tick, vector(a, SAMPLE_));
    for (int64_t i = 0; i < a->fresh.count; i++) book(a, a->fresh.ticks[i], a->fresh.values + i * n);
    if (a->stamp > passed) {
        Queue *u = &a->until;
        for (int64_t k = 0; k < n; k++) {
            mean[k] /= (double)(a->stamp - passed);
            for (int64_t i = 0; i < u->count; i++)
                vector(a, SWING)[k] = larger(vector(a, SWING)[k], fabs(mean[k] - u->values[i * n + k]));
        }
        int64_t known = 0;
        while (known < u->count && (u->ticks[known] <= a->stamp || !a->delayed)) known++;
        drop(u, n, known);
    }
    a->fresh.count = 0;
    a->tick = tick;
    memcpy(before, x, bytes);
}

static void predict(Account *a, const Loop *l, double step) {
    if (!a->velocity.n) {
        memcpy(vector(a, STEADY), vector(a, MOTION), a->n * sizeof(double));
        memcpy(vector(a, PREDICTED), vector(a, MOTION), a->n * sizeof(double));
        return;
    }
    double *v = vector(a, NOW);
    read_all(&a->velocity, l->values, v);
    if ((double)a->steps > step) step = (double)a->steps;
    const double seconds = step * l->numerator / l->denominator;
    for (int64_t k = 0; k < a->n; k++) {
        if (a->steps) vector(a, GAIN)[k] = (v[k] - vector(a, V)[k]) / (double)a->steps;
        vector(a, V)[k] = v[k];
        vector(a, STEADY)[k] = v[k] * seconds;
        vector(a, PREDICTED)[k] = vector(a, STEADY)[k] + vector(a, GAIN)[k] * (step / 2 * seconds);
    }
}

/* Account.credit */
double account_credit(const Account *a, const Loop *l) {
    double *x = vector(a, NOW), work = 0.0;
    read_all(&a->displacement, l->values, x);
    for (int64_t k = 0; k < a->n; k++)
        work += vector(a, WORK)[k] + vector(a, HELD)[k] * (x[k] - vector(a, X)[k]);
    return a->promised - work;
}

/* Account._share */
static void share(Account *a, int64_t tick) {
    if (a->since == tick) {
        a->tank->available += a->promise;
        a->promised -= a->promise;
    }
    a->promise = tank_share(
        a->tank, vector(a, HELD), vector(a, PREDICTED), vector(a, STEADY),
        a->passive ? vector(a, BETA) : NULL
    );
    a->promised += a->promise;
    a->since = tick;
}

static double generated(const Account *a, int64_t k) {
    const double moved = vector(a, X)[k] - vector(a, X_STAMP)[k];
    return vector(a, WORK)[k] - vector(a, IDEAL)[k] - vector(a, SAMPLE_)[k] * moved;
}

static double travelled(const Account *a, int64_t k) {
    double from = vector(a, X_STAMP)[k], length = 0.0;
    if (!a->delayed) return fabs(vector(a, X)[k] - from);
    for (int64_t i = 0; i < a->path.count; i++) {
        if (a->path.ticks[i] <= a->stamp) continue;
        length += fabs(a->path.values[i * a->n + k] - from);
        from = a->path.values[i * a->n + k];
    }
    return length;
}

static const double STOPPED = 0.01; /* passive.STOPPED */

/* Passive.correction */
static double passive(const Account *a, int64_t k) {
    double *beta = vector(a, BETA) + k, *last = vector(a, LAST) + k;
    const double predicted = vector(a, PREDICTED)[k], swing = vector(a, SWING)[k];
    if (vector(a, MOTION)[k] * *last < -STOPPED * (*last * *last))
        *beta /= 2;
    else
        *beta = 1.1 * *beta > 1.0 ? 1.0 : 1.1 * *beta;
    *last = predicted;
    const double bound = generated(a, k) + swing * travelled(a, k);
    const double distance = fabs(predicted) + (bound > 0.0 ? 0.0 : fabs(vector(a, STEADY)[k]));
    const double friction = swing + (distance > 0.0 ? bound / distance : 0.0);
    const double most = larger(swing, vector(a, LARGEST)[k]);
    const double sign = predicted > 0.0 ? 1.0 : predicted < 0.0 ? -1.0 : predicted == 0.0 ? 0.0 : predicted;
    return -sign * *beta * (friction < 0.0 ? 0.0 : friction > most ? most : friction);
}

/* NearlyEnergyPreserving.correction of a new sample */
static double nearly(const Account *a, int64_t k) {
    double *last = vector(a, LAST) + k;
    const double moved = vector(a, X)[k] - *last, most = vector(a, LARGEST)[k];
    *last = vector(a, X)[k];
    vector(a, TRAVELLED)[k] = moved;
    const double effort = moved != 0.0 ? -generated(a, k) / moved : 0.0;
    return effort < -most ? -most : effort > most ? most : effort;
}

void account_value(Account *a, const Loop *l, int64_t tick, double ahead, double *value) {
    double *held = vector(a, HELD);
    if (tick > a->tick || a->fresh.count) {
        const int fresh = a->fresh.count > 0;
        account(a, l, tick);
        predict(a, l, 2 * ahead);
        for (int64_t k = 0; k < a->n; k++) {
            double *correction = vector(a, BETA) + k;
            if (!a->passive && fresh) *correction = nearly(a, k);
            held[k] = vector(a, SAMPLE_)[k] + (a->passive ? passive(a, k) : *correction);
        }
        if (a->tank) share(a, tick);
    }
    memcpy(value, held, a->n * sizeof *value);
}
