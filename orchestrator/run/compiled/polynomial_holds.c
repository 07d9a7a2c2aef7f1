/* Holds whose value is a polynomial in time, through samples or towards them. y, y1, y2: the newest
 * sample y_n and those before it, with the instants that they describe (stamps) t_n, t_{n-1}, t_{n-2}; behind n entries
 * of a sample are its derivatives (per s) or integrals, where the hold needs these.
 *
 * Until the second sample each of them is the zero-order hold, unless it is said otherwise. */

#include "loop.h"
#include "hold_table.h"

#include <string.h>

_Static_assert(DEEPEST <= sizeof ((Hold *)0)->stamps / sizeof(int64_t),
               "loop.h: Hold.stamps has too few entries for the deepest row of the table of holds");

/* s: time since the newest stamp, t - t_n; H, H1: t_n - t_{n-1} and t_{n-1} - t_{n-2} (ticks). */
typedef struct {
    const double *y, *y1, *y2;
    double s, H, H1;
    int64_t n, count;
} Samples;

static Samples samples(const Hold *h, int64_t tick, double ahead) {
    const int64_t last = h->count - 1, *t = h->stamps + last;
    const double *y = h->samples + last * h->width;
    return (Samples){
        .y = y,
        .y1 = last > 0 ? y - h->width : y,
        .y2 = last > 1 ? y - 2 * h->width : y,
        .s = (double)(tick - *t) + ahead,
        .H = last > 0 ? (double)(t[0] - t[-1]) : 0.0,
        .H1 = last > 1 ? (double)(t[-1] - t[-2]) : 0.0,
        .n = h->n,
        .count = h->count,
    };
}

static double seconds(const Loop *l, double ticks) {
    return ticks * l->numerator / l->denominator;
}

/* A second sample with the same stamp replaces the first. */
int push_samples(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    const size_t row = h->width * sizeof *y;
    (void)arrival;
    if (h->count && h->stamps[h->count - 1] == stamp) h->count--;
    if (h->count == h->depth) {
        memmove(h->samples, h->samples + h->width, (h->depth - 1) * row);
        memmove(h->stamps, h->stamps + 1, (h->depth - 1) * sizeof stamp);
        h->count--;
    }
    memcpy(h->samples + h->count * h->width, y, row);
    h->stamps[h->count++] = stamp;
    return 0;
}

#define LAW(name)                                                                                  \
    int value_##name(Hold *h, const Loop *l, int64_t tick, double ahead, double *value)
#define EACH(law) for (int64_t k = 0; k < x.n; k++) value[k] = law

/* y_n. Order 1; a delay of half a period at low frequency. */
LAW(zero_order) {
    const Samples x = samples(h, tick, ahead);
    (void)l;
    EACH(x.y[k]);
    return 0;
}

/* Half-step lead: y_n + (y_n - y_{n-1}) (1/2 + a/H), constant until the next sample; a: how much later than its stamp
 * the sample was known, by latency or since it was computed for a whole frame.
 *
 * The first-order hold evaluated at the middle of a period: order 2 where the target holds its inputs
 * constant over the period, and no delay at low frequency. So it is where a period is a whole number of
 * the target's steps h: at rates that do not divide each other the newest sample is h/2 older in the
 * mean, an error of order 1. */
LAW(lead) {
    const Samples x = samples(h, tick, ahead);
    if (x.count < 2) return value_zero_order(h, l, tick, ahead, value);
    const int64_t late = h->arrival - h->stamps[h->count - 1];
    const double lead = 0.5 + (late > 0 ? (double)late / x.H : 0.0);
    EACH(x.y[k] + (x.y[k] - x.y1[k]) * lead);
    return 0;
}

int push_lead(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    h->arrival = arrival;
    return push_samples(h, y, stamp, arrival);
}

/* y_n + (y_n - y_{n-1}) s/H. Order 2, no delay at low frequency; amplifies at most 1.59-fold, at
 * omega H = 2.13. */
LAW(first_order) {
    const Samples x = samples(h, tick, ahead);
    if (x.count < 2) return value_zero_order(h, l, tick, ahead, value);
    EACH(x.y[k] + (x.y[k] - x.y1[k]) / x.H * x.s);
    return 0;
}

/* First-order hold from the source's own derivative: y_n + yd_n s.
 *
 * Order 2 from the first sample on and no delay at low frequency; unlike `foh` it does not amplify noise
 * by a difference of samples. */
LAW(first_order_derivative) {
    const Samples x = samples(h, tick, ahead);
    const double *yd = x.y + x.n, elapsed = seconds(l, x.s);
    EACH(x.y[k] + yd[k] * elapsed);
    return 0;
}

/* Second-order hold: the quadratic through the three newest samples, in Newton's form,
 *
 * y_n + d1 (t - t_n) + d2 (t - t_n)(t - t_{n-1}),  d1 = [y_n, y_{n-1}],  d2 = [y_n, y_{n-1}, y_{n-2}]
 *
 * with divided differences, so that periods may vary. Order 3; amplifies at most 2.83-fold, at
 * omega H = 2.61. With two samples it is the first-order hold. */
LAW(second_order) {
    const Samples x = samples(h, tick, ahead);
    if (x.count < 3) return value_first_order(h, l, tick, ahead, value);
    for (int64_t k = 0; k < x.n; k++) {
        const double d1 = (x.y[k] - x.y1[k]) / x.H;
        const double d2 = (d1 - (x.y1[k] - x.y2[k]) / x.H1) / (x.H + x.H1);
        value[k] = x.y[k] + d1 * x.s + d2 * (x.s * (x.s + x.H));
    }
    return 0;
}

/* Cubic Hermite hold: the cubic through the two newest samples and their derivatives.
 *
 * With r = (t - t_{n-1})/H: h00 y_{n-1} + h10 H yd_{n-1} + h01 y_n + h11 H yd_n,
 * h00 = (1 + 2 r)(1 - r)^2, h10 = r (1 - r)^2, h01 = r^2 (3 - 2 r), h11 = r^2 (r - 1). Order 4.
 * Meant for interpolation (coupling = "iterated"); extrapolated it amplifies more than the second-order
 * hold. With one sample it is the first-order hold from the derivative. */
LAW(hermite) {
    const Samples x = samples(h, tick, ahead);
    if (x.count < 2) return value_first_order_derivative(h, l, tick, ahead, value);
    const double *yd = x.y + x.n, *yd1 = x.y1 + x.n, period = seconds(l, x.H);
    const double r = (x.s + x.H) / x.H, falling = (1 - r) * (1 - r), rising = r * r;
    for (int64_t k = 0; k < x.n; k++) {
        const double before = (1 + 2 * r) * falling * x.y1[k] + r * falling * period * yd1[k];
        value[k] = before + (3 - 2 * r) * rising * x.y[k] + (r - 1) * rising * period * yd[k];
    }
    return 0;
}

/* Slope hold, for the velocity beside a pose that `foh` holds: (x_n - x_{n-1})/H, x the pose.
 *
 * It is the rate of the held pose x_n + (x_n - x_{n-1}) s/H, so that a spring and damper get a pose and a
 * velocity that agree; 0 until the second sample, as that pose is constant. As a velocity it is that of
 * H/2 before t_n: order 1, and a delay of a period at low frequency. A sample is the velocity followed
 * by the pose (its unit times s). */
LAW(slope) {
    const Samples x = samples(h, tick, ahead);
    const double *pose = x.y + x.n, *pose1 = x.y1 + x.n, period = seconds(l, x.H);
    if (x.count < 2)
        EACH(x.y[k] - x.y[k]);
    else
        EACH((pose[k] - pose1[k]) / period);
    return 0;
}

/* --- towards the newest sample ------------------------------------------------------------------
 *
 * w, wd: value and slope (per tick) that the hold had when sample n arrived; r: the time since then,
 * divided by H. The sample is reached at r = 1. */

static double since_arrival(const Hold *h, double H, int64_t tick, double ahead) {
    return ((double)(tick - h->arrival) + ahead) / H;
}

/* Delayed interpolation: from the arrival of sample n, a straight line that reaches y_n after H:
 * w + (y_n - w) min(1, r).
 *
 * w = y_{n-1} at a constant sampling period. Continuous, never overshoots the samples, and delayed by H:
 * order 1. */
LAW(delayed) {
    const Samples x = samples(h, tick, ahead);
    const double *w = h->memory, r = since_arrival(h, x.H, tick, ahead);
    if (x.count < 2 || r >= 1.0) return value_zero_order(h, l, tick, ahead, value);
    EACH(w[k] + (x.y[k] - w[k]) * r);
    return 0;
}

int push_delayed(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    if (h->count)
        value_delayed(h, NULL, arrival, 0.0, h->memory); /* each entry is read before it is written */
    else
        memcpy(h->memory, y, h->n * sizeof *y);
    h->arrival = arrival;
    return push_samples(h, y, stamp, arrival);
}

/* Smooth hold: continuous in value and slope (C1), delayed by H.
 *
 * A cubic Hermite curve from the held value w and slope wd at the arrival of sample n to y_n with the
 * slope (y_n - y_{n-1})/H, which it reaches H later and continues as a straight line:
 *
 * w (1 + 2r)(1 - r)^2 + wd H r (1 - r)^2 + y_n r^2 (3 - 2r) + (y_n - y_{n-1}) r^2 (r - 1)
 *
 * Order 1. */
LAW(smooth) {
    const Samples x = samples(h, tick, ahead);
    const double *w = h->memory, *wd = w + x.n, r = since_arrival(h, x.H, tick, ahead);
    if (x.count < 2) return value_zero_order(h, l, tick, ahead, value);
    if (r >= 1.0) {
        EACH(x.y[k] + (x.y[k] - x.y1[k]) * (r - 1.0));
        return 0;
    }
    const double falling = (1.0 - r) * (1.0 - r);
    for (int64_t k = 0; k < x.n; k++) {
        const double start = w[k] * ((1 + 2 * r) * falling) + wd[k] * x.H * (r * falling);
        value[k] = start + (x.y[k] * (r * r * (3 - 2 * r)) + (x.y[k] - x.y1[k]) * (r * r * (r - 1)));
    }
    return 0;
}

/* The slope of `smooth` (per tick), 0 until the second sample. */
static void slope_of_smooth(const Hold *h, int64_t tick, double *value) {
    const Samples x = samples(h, tick, 0.0);
    const double *w = h->memory, *wd = w + x.n, r = since_arrival(h, x.H, tick, 0.0);
    if (x.count < 2) {
        EACH(x.y[k] - x.y[k]);
    } else if (r >= 1.0) {
        EACH((x.y[k] - x.y1[k]) / x.H);
    } else {
        for (int64_t k = 0; k < x.n; k++) {
            const double slope = (x.y[k] - w[k]) * (6 * r * (1 - r)) + wd[k] * x.H * ((1 - r) * (1 - 3 * r));
            value[k] = (slope + (x.y[k] - x.y1[k]) * (r * (3 * r - 2))) / x.H;
        }
    }
}

int push_smooth(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    double *w = h->memory, *new = h->scratch + 4 * h->n;
    if (h->count) {
        value_smooth(h, NULL, arrival, 0.0, new);
        slope_of_smooth(h, arrival, new + h->n);
        memcpy(w, new, 2 * h->n * sizeof *y);
    } else {
        memcpy(w, y, h->n * sizeof *y);
    }
    h->arrival = arrival;
    return push_samples(h, y, stamp, arrival);
}
