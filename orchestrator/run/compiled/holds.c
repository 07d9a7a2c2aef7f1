/* The shipped holds. Each is what its Python class is, operation by operation: the classes in
 * `orchestrator/holds/` are the specification and have the equations. */

#include "loop.h"

#include <math.h>
#include <string.h>

static double seconds(const Loop *l, double ticks) {
    return ticks * l->numerator / l->denominator;
}

static double *sample(const Hold *h, int64_t i) { return h->samples + i * h->width; }

static double *vector(const Hold *h, int64_t i) { return h->vectors + i * h->n; }

double *hold_scratch(const Hold *h) { return vector(h, 6); }

/* History.push: a second sample with the same stamp replaces the first. */
static void keep(Hold *h, const double *y, int64_t stamp) {
    if (h->count && h->stamps[h->count - 1] == stamp) h->count--;
    if (h->count == h->depth) {
        memmove(h->samples, sample(h, 1), (h->depth - 1) * h->width * sizeof *y);
        memmove(h->stamps, h->stamps + 1, (h->depth - 1) * sizeof stamp);
        h->count--;
    }
    memcpy(sample(h, h->count), y, h->width * sizeof *y);
    h->stamps[h->count++] = stamp;
}

/* History.slope at sample i, entry k. */
static double slope(const Hold *h, int64_t i, int64_t k) {
    if (i < 1) return 0.0;
    return (sample(h, i)[k] - sample(h, i - 1)[k]) / (double)(h->stamps[i] - h->stamps[i - 1]);
}

/* --- delayed, smooth, mean -------------------------------------------------------------------- */

static void delayed(const Hold *h, int64_t tick, double ahead, double *value) {
    const int64_t newest = h->count - 1, before = h->stamps[0], stamp = h->stamps[newest];
    const double *y = sample(h, newest), *from = vector(h, 0);
    double share = 1.0;
    if (stamp > before) share = ((double)(tick - h->arrival) + ahead) / (double)(stamp - before);
    for (int64_t k = 0; k < h->n; k++)
        value[k] = share >= 1.0 ? y[k] : from[k] + (y[k] - from[k]) * share;
}

/* Value and slope (per tick) of Smooth at `time`. */
static void curve(const Hold *h, double time, double *value, double *tangent) {
    const int64_t last = h->count - 1;
    const double *first = sample(h, 0), *newest = sample(h, last);
    const double *start = vector(h, 0), *begun = vector(h, 1);
    const double period = (double)(h->stamps[last] - h->stamps[0]);
    const double r = (time - (double)h->arrival) / period;
    for (int64_t k = 0; k < h->n; k++) {
        if (h->stamps[last] == h->stamps[0]) {
            value[k] = newest[k];
            if (tangent) tangent[k] = 0.0;
            continue;
        }
        const double rise = newest[k] - first[k];
        if (r >= 1.0) {
            value[k] = newest[k] + rise * (r - 1.0);
            if (tangent) tangent[k] = rise / period;
            continue;
        }
        const double s = begun[k] * period, falling = (1.0 - r) * (1.0 - r);
        double y = start[k] * ((1 + 2 * r) * falling) + s * (r * falling);
        y += newest[k] * (r * r * (3 - 2 * r)) + rise * (r * r * (r - 1));
        value[k] = y;
        if (!tangent) continue;
        double t = (newest[k] - start[k]) * (6 * r * (1 - r)) + s * ((1 - r) * (1 - 3 * r));
        t += rise * (r * (3 * r - 2));
        tangent[k] = t / period;
    }
}

/* vectors: newest, held, sum; arrival is its stamp. */
static void mean_push(Hold *h, const double *y, int64_t stamp) {
    double *newest = vector(h, 0), *held = vector(h, 1), *sum = vector(h, 2);
    if (h->begun && stamp > h->arrival) {
        h->interval = stamp - h->arrival;
        for (int64_t k = 0; k < h->n; k++) sum[k] += (newest[k] + y[k]) * ((double)h->interval / 2);
        h->span += h->interval;
    } else if (h->span) {
        for (int64_t k = 0; k < h->n; k++) sum[k] += (y[k] - newest[k]) * ((double)h->interval / 2);
    } else if (!h->interval) {
        memcpy(held, y, h->n * sizeof *y);
    }
    h->begun = 1;
    h->arrival = stamp;
    memcpy(newest, y, h->n * sizeof *y);
}

static void mean_value(Hold *h, double *value) {
    double *held = vector(h, 1), *sum = vector(h, 2);
    if (h->span) {
        for (int64_t k = 0; k < h->n; k++) {
            held[k] = sum[k] / (double)h->span;
            sum[k] = 0.0;
        }
        h->span = 0;
    }
    memcpy(value, held, h->n * sizeof *value);
}

/* --- all kinds -------------------------------------------------------------------------------- */

static void take(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    switch (h->kind) {
    case DELAYED:
        if (h->count)
            delayed(h, arrival, 0.0, vector(h, 1));
        else
            memcpy(vector(h, 1), y, h->n * sizeof *y);
        memcpy(vector(h, 0), vector(h, 1), h->n * sizeof *y);
        h->arrival = arrival;
        break;
    case SMOOTH:
        if (h->count) {
            curve(h, (double)arrival, vector(h, 2), vector(h, 3));
            memcpy(vector(h, 0), vector(h, 2), 2 * h->n * sizeof *y);
        } else {
            memcpy(vector(h, 0), y, h->n * sizeof *y);
        }
        h->arrival = arrival;
        break;
    case MEAN: mean_push(h, y, stamp); return;
    case PASSIVE_SET_POSITION:
        memcpy(h->tank->newest + h->row * h->n, y, h->n * sizeof *y);
        if (h->width > h->n) tank_credit(h->tank, y[h->n]);
        return;
    case OBSERVED: account_push(h->account, y, stamp, arrival); return;
    }
    keep(h, y, stamp);
}

/* manifolds.Unwrapped; `y` is the caller's to change. */
static void unwrap(Hold *h, double *y) {
    for (int64_t i = 0; i < h->n_angles; i++) {
        double *angle = y + h->angles[i];
        if (h->unwrapped) *angle += h->turns[i] * rint((h->last[i] - *angle) / h->turns[i]);
        h->last[i] = *angle;
    }
    h->unwrapped = 1;
}

/* As if there had been no sample yet. */
static void restart(Hold *h) {
    h->count = h->arrival = h->span = h->interval = h->begun = 0;
    memset(h->vectors, 0, 4 * h->n * sizeof *h->vectors);
}

static void push(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    if (h->n_angles) {
        double *own = vector(h, 4);
        memcpy(own, y, h->width * sizeof *y);
        unwrap(h, own);
        y = own;
    }
    if (h->manifold && manifold_push(h, y)) restart(h);
    take(h, y, stamp, arrival);
}

/* Link.send, kept in the order of (arrival, stamp). */
static int send(Link *k, const double *y, int64_t width, int64_t stamp, int64_t from) {
    if (k->at_late == k->n_late) return DRAW;
    if (k->n == k->room) return GROW;
    const int64_t late = k->late[k->at_late++];
    k->sent++;
    if (late < 0) {
        k->lost++;
        return 0;
    }
    const int64_t arrival = stamp + late > from ? stamp + late : from;
    int64_t i = k->n++;
    for (; i > 0; i--) {
        const int64_t a = k->arrivals[i - 1], s = k->stamps[i - 1];
        if (a < arrival || (a == arrival && s <= stamp)) break;
        k->arrivals[i] = a;
        k->stamps[i] = s;
        memcpy(k->samples + i * width, k->samples + (i - 1) * width, width * sizeof *y);
    }
    k->arrivals[i] = arrival;
    k->stamps[i] = stamp;
    memcpy(k->samples + i * width, y, width * sizeof *y);
    return 0;
}

static void receive(Hold *h, int64_t tick) {
    Link *k = h->link;
    int64_t gone = 0;
    for (; gone < k->n && k->arrivals[gone] <= tick; gone++) {
        if (k->stamps[gone] < k->newest) {
            k->overtaken++;
            continue;
        }
        k->newest = k->stamps[gone];
        push(h, k->samples + gone * h->width, k->stamps[gone], k->arrivals[gone]);
    }
    if (!gone) return;
    k->n -= gone;
    memmove(k->arrivals, k->arrivals + gone, k->n * sizeof *k->arrivals);
    memmove(k->stamps, k->stamps + gone, k->n * sizeof *k->stamps);
    memmove(k->samples, k->samples + gone * h->width, k->n * h->width * sizeof *k->samples);
}

int hold_push(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    if (h->link && h->link->started) return send(h->link, y, h->width, stamp, arrival);
    if (h->account && !account_has_room(h->account, 1)) return GROW;
    push(h, y, stamp, arrival);
    if (h->link) h->link->started = 1;
    return 0;
}

static void extrapolate(const Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    const int64_t n = h->n;
    const int64_t last = h->count - 1;
    const double *y = sample(h, last), *first = sample(h, 0);
    const double s = (double)(tick - h->stamps[last]) + ahead;
    switch (h->kind) {
    case ZERO_ORDER: memcpy(value, y, n * sizeof *value); return;
    case LEAD:
        for (int64_t k = 0; k < n; k++) value[k] = y[k] + (y[k] - first[k]) / 2;
        return;
    case FIRST_ORDER:
        for (int64_t k = 0; k < n; k++) value[k] = y[k] + slope(h, last, k) * s;
        return;
    case FIRST_ORDER_DERIVATIVE: {
        const double elapsed = seconds(l, s);
        for (int64_t k = 0; k < n; k++) value[k] = y[k] + y[n + k] * elapsed;
        return;
    }
    case SECOND_ORDER:
        for (int64_t k = 0; k < n; k++) {
            const double d1 = slope(h, last, k);
            value[k] = y[k] + d1 * s;
            if (h->count < 3) continue;
            const double d2 = (d1 - slope(h, last - 1, k)) / (double)(h->stamps[2] - h->stamps[0]);
            value[k] += d2 * (s * (s + (double)h->stamps[2] - (double)h->stamps[1]));
        }
        return;
    case HERMITE: {
        const double elapsed = seconds(l, s), whole = (double)(h->stamps[last] - h->stamps[0]);
        const double r = ((double)(tick - h->stamps[0]) + ahead) / whole, width = seconds(l, whole);
        const double falling = (1 - r) * (1 - r), rising = r * r;
        const double a = (1 + 2 * r) * falling, b = r * falling * width;
        const double c = (3 - 2 * r) * rising, d = (r - 1) * rising * width;
        for (int64_t k = 0; k < n; k++)
            value[k] = h->count < 2
                           ? y[k] + y[n + k] * elapsed
                           : a * first[k] + b * first[n + k] + c * y[k] + d * y[n + k];
        return;
    }
    case SLOPE: {
        const double width = seconds(l, (double)(h->stamps[last] - h->stamps[0]));
        for (int64_t k = 0; k < n; k++)
            value[k] = h->count < 2 ? 0.0 : (y[n + k] - first[n + k]) / width;
        return;
    }
    case DELAYED: delayed(h, tick, ahead, value); return;
    case SMOOTH: curve(h, (double)tick + ahead, value, NULL); return;
    }
}

/* The value at `tick`, or GROW. */
int hold_value(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    if (h->account && !account_has_room(h->account, h->link ? h->link->n : 0)) return GROW;
    if (h->link) receive(h, tick);
    switch (h->kind) {
    case MEAN: mean_value(h, value); break;
    case PASSIVE_SET_POSITION:
        tank_modulate(h->tank, l, tick);
        memcpy(value, h->tank->modulated + h->row * h->n, h->n * sizeof *value);
        break;
    case OBSERVED: account_value(h->account, l, tick, ahead, value); break;
    default: extrapolate(h, l, tick, ahead, value);
    }
    if (h->manifold) manifold_value(h, value);
    return 0;
}
