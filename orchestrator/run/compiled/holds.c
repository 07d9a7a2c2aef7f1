/* The shipped holds: what they keep of their samples. The laws of those whose value is a polynomial
 * in time are `orchestrator/holds/laws_of_holds.py`; generate_laws.py writes hold_laws.h from it. Of the
 * others the classes in `orchestrator/holds/` are the specification, operation by operation. */

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

#define LAW(kind, i) (3 * (kind) + (i))

/* The value of a law of laws_of_holds.py, of `kind`: the hold's own, or that of its slope. Without a loop
 * there are no seconds. */
static void law(const Hold *h, int64_t kind, const Loop *l, int64_t tick, double ahead, double *value) {
    const int64_t n = h->n, last = h->count - 1, *t = h->stamps + last;
    const double *y = sample(h, last), *y1 = sample(h, last > 0 ? last - 1 : 0), *y2 = h->samples;
    const double *w = vector(h, 0), *wd = vector(h, 1);
    const double s = (double)(tick - t[0]) + ahead, elapsed = l ? seconds(l, s) : 0.0;
    const double H = last > 0 ? (double)(t[0] - t[-1]) : 0.0, period = l ? seconds(l, H) : 0.0;
    const double H1 = last > 1 ? (double)(t[-1] - t[-2]) : 0.0;
    const double r = ((double)(tick - h->arrival) + ahead) / H;
    const int reached = last > 0 && r >= 1.0 && (h->kind == DELAYED || h->kind == SMOOTH);
    switch (LAW(kind, last + reached)) {
#include "hold_laws.h"
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
    case SMOOTH:
        if (h->count) {
            law(h, h->kind, NULL, arrival, 0.0, vector(h, 2));
            if (h->kind == SMOOTH) law(h, SMOOTH_SLOPE, NULL, arrival, 0.0, vector(h, 3));
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

/* holds_on_manifolds.Unwrapped; `y` is the caller's to change. */
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

/* Link.draw: the next latency (ticks), -1 for a lost sample. All but the loss are whole numbers. */
static int64_t draw(Link *k) {
    const uint64_t share = random_bits(&k->generator), luck = random_bits(&k->generator);
    if ((double)luck * 0x1p-53 < k->loss) return -1;
    /* ceil(N / (unit 2^53)), N = low 2^53 + spread share. A division of 128 bits would call a
     * function of the compiler's library, which a program lacks. */
    const __uint128_t product = (__uint128_t)k->spread * share;
    const uint64_t whole = (uint64_t)k->low + (uint64_t)(product >> 53), unit = (uint64_t)k->unit;
    const uint64_t rest = (uint64_t)product & ((1ull << 53) - 1);
    return (int64_t)(whole / unit + (whole % unit || rest));
}

/* Link.send, kept in the order of (arrival, stamp). */
static int send(Link *k, const double *y, int64_t width, int64_t stamp, int64_t from) {
    if (k->n == k->room) return GROW;
    const int64_t late = draw(k);
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

int hapticlink_push(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    if (h->link && h->link->started) return send(h->link, y, h->width, stamp, arrival);
    if (h->account && !account_has_room(h->account, 1)) return GROW;
    push(h, y, stamp, arrival);
    if (h->link) h->link->started = 1;
    return 0;
}

/* The value at `tick`, or GROW. */
int hapticlink_value(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    if (h->account && !account_has_room(h->account, h->link ? h->link->n : 0)) return GROW;
    if (h->link) receive(h, tick);
    switch (h->kind) {
    case MEAN: mean_value(h, value); break;
    case PASSIVE_SET_POSITION:
        tank_modulate(h->tank, l, tick);
        memcpy(value, h->tank->modulated + h->row * h->n, h->n * sizeof *value);
        break;
    case OBSERVED: account_value(h->account, l, tick, ahead, value); break;
    default: law(h, h->kind, l, tick, ahead, value);
    }
    if (h->manifold) manifold_value(h, value);
    return 0;
}
