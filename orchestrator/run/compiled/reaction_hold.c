/* An effort of a hand that reacts to the motion of the target, which holds it for a whole step H: its mean over that step.
 *
 * Of the samples of the last step, those of both ends included, the effort is taken for F = F_0 - k x - b v in each entry, x and v
 * of the handle, by least squares with a ridge RIDGE in scaled x and v; k, b >= 0. Motions far below STILL are none. Handle and
 * mechanism share a mobility, and the coupling between them is none of their common motion, so that over the step
 *
 * x = x_n + v_n s + Lambda^-1 F s^2/2,  v = v_n + Lambda^-1 F s,
 * F = F_n + (r - mean r)/2 - k mean(x - x_n) - b mean(v - v_n),  r = F + k x + b v
 *
 * (v_n: the mean of both velocities), which is linear in F:
 *
 * (1 + g Lambda^-1) F = F_n + (r - mean r)/2 - k v_n H/2,  g = k H^2/6 + b H/2.
 *
 * Implicit, so that a stiff hand is not fed back a step late; with k = b = 0 it is half-lead.
 *
 * A sample is F, x, v. beside: as of mid. memory: the newest sample; the first one of the step; sums of F, x, v, xx, xv, vv, xF,
 * vF from there, without the newest; the value. interval: samples in the sums; span: 1 + the tick of the value. */

#include "loop.h"
#include "hold_table.h"

#include <math.h>
#include <string.h>

enum { MOST = 6 }; /* entries, which `assign_holds` guards */
enum { FIRST = 3, SUMS = 6, VALUE = 14 };

#define RIDGE 0.3
#define STILL 1e-5 /* m, rad */

static double *row(const Hold *h, int64_t i) { return h->memory + i * h->n; }

/* Adds the newest sample to sums (8 a row). */
static void add(const Hold *h, double *sums) {
    const int64_t n = h->n;
    for (int64_t k = 0; k < n; k++) {
        const double *now = h->memory + k, *first = row(h, FIRST) + k;
        const double F = now[0] - first[0], x = now[n] - first[n], v = now[2 * n] - first[2 * n];
        const double terms[] = {F, x, v, x * x, x * v, v * v, x * F, v * F};
        for (int64_t i = 0; i < 8; i++) sums[i * n + k] += terms[i];
    }
}

int push_reaction(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    (void)arrival;
    if (h->begun && stamp > h->arrival) {
        if (!h->interval) memcpy(row(h, FIRST), h->memory, 3 * h->n * sizeof *y);
        add(h, row(h, SUMS));
        h->interval++;
    }
    if (stamp >= h->span) h->span = 0;
    memcpy(h->memory, y, 3 * h->n * sizeof *y);
    h->begun = 1;
    h->arrival = stamp;
    return 0;
}

/* The mean of an entry over a step of H (s) without what it gives way; stiffness and damping of the hand there. */
static double given(const Hold *h, int64_t k, double H, double *stiffness, double *damping) {
    const int64_t n = h->n;
    const double *s = row(h, SUMS) + k, *now = h->memory + k, *first = row(h, FIRST) + k;
    const double m = (double)h->interval, F = s[0] / m, x = s[n] / m, v = s[2 * n] / m;
    const double xx = s[3 * n] / m - x * x, xv = s[4 * n] / m - x * v, vv = s[5 * n] / m - v * v;
    const double xF = s[6 * n] / m - x * F, vF = s[7 * n] / m - v * F;
    const double far = sqrt(fmax(xx, 0.0) + STILL * STILL), fast = sqrt(fmax(vv, 0.0) + STILL * STILL / (H * H));
    const double a = xx / (far * far) + RIDGE, b = xv / (far * fast), c = vv / (fast * fast) + RIDGE;
    const double p = -xF / far, q = -vF / fast, det = a * c - b * b;
    *stiffness = fmax((c * p - b * q) / (det * far), 0.0);
    *damping = fmax((a * q - b * p) / (det * fast), 0.0);
    const double dx = now[n] - first[n] - x, dv = now[2 * n] - first[2 * n] - v;
    return now[0] + (now[0] - first[0] - F + *stiffness * dx + *damping * dv) / 2;
}

static void predict(Hold *h, const Loop *l, double H, double *F) {
    const int64_t n = h->n;
    double system[MOST * MOST];
    add(h, row(h, SUMS));
    h->interval++;
    for (int64_t k = 0; k < n; k++) {
        double stiffness, damping;
        F[k] = given(h, k, H, &stiffness, &damping);
        const double v = (reading(&h->beside, l->values, 2 * n + k) + reading(&h->beside, l->values, 3 * n + k)) / 2;
        const double g = stiffness * H * H / 6 + damping * H / 2;
        F[k] -= stiffness * v * H / 2;
        for (int64_t j = 0; j < n; j++)
            system[k * n + j] = (k == j) + g * reading(&h->beside, l->values, 4 * n + k * n + j);
    }
    solve(system, F, n);
}

/* The same for all parts of a step, the first of which is asked for at its middle. */
int value_reaction(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    double *F = row(h, VALUE);
    const size_t bytes = h->n * sizeof *value;
    if (h->span != tick + 1) {
        const double ticks = 2.0 * (double)h->parts * (ahead + (double)l->late);
        if (h->interval && ticks > 0.0)
            predict(h, l, ticks * l->numerator / l->denominator, F);
        else
            memcpy(F, h->memory, bytes);
        memset(row(h, SUMS), 0, 8 * bytes);
        h->interval = 0;
        h->span = tick + 1;
    }
    memcpy(value, F, bytes);
    return 0;
}
