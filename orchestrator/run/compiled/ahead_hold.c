/* Of an FMU whose step is taken when it begins, so that its samples describe the end of the step: between those of both
 * ends nothing is guessed. With r = (t - t_n)/H from t_n to t_{n+1}:
 *
 * x, where its rate v is beside it: the cubic through both with the slopes v_n and v_{n+1};
 * v, where x is beside it: the slope of that cubic;
 * anything else: the straight line, then as for all matrices.
 *
 * Until the sample of t_{n+1} is there, which a computing time puts off, s behind t_n:
 *
 * x_n + v_n s + a s^2/2,  v_n + a s,  a = Lambda^-1 sum_j F_j + a_bias,
 *
 * with the efforts F_j that the FMU holds over its step, and Lambda^-1 and a_bias of t_n, where these are behind the sample
 * (a = 0 where they are not); anything else stays as it is. */

#include "loop.h"
#include "hold_table.h"

#include <string.h>

/* a (n), of the newest sample y. */
static void acceleration(const Hold *h, const Loop *l, const double *y, double *a) {
    const int64_t n = h->n;
    const double *mobility = y + 2 * n, *bias = mobility + n * n;
    memset(a, 0, n * sizeof *a);
    if (h->width == 2 * n) return;
    for (int64_t k = 0; k < n; k++) {
        double effort = 0.0;
        for (int64_t j = k; j < h->beside.n; j += n) effort += reading(&h->beside, l->values, j);
        for (int64_t i = 0; i < n; i++) a[i] += mobility[i * n + k] * effort;
    }
    for (int64_t i = 0; i < n; i++) a[i] += bias[i];
}

static int beyond_samples(const Hold *h, const Loop *l, double s, double *value) {
    const int64_t n = h->n;
    const double *y = h->samples + (h->count - 1) * h->width, *other = y + n;
    double *a = h->scratch + 4 * n;
    memcpy(value, y, n * sizeof *y);
    if (h->relation == ALONE) return 0;
    acceleration(h, l, y, a);
    for (int64_t k = 0; k < n; k++)
        value[k] += h->relation == WITH_RATE ? s * (other[k] + s / 2 * a[k]) : s * a[k];
    return 0;
}

int value_ahead(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    const int64_t last = h->count - 1, *t = h->stamps + last;
    const double past = (double)(tick - *t) + ahead, second = l->numerator / l->denominator;
    if (past >= 0.0 || last == 0) return beyond_samples(h, l, past > 0.0 ? past * second : 0.0, value);
    if (h->relation == WITH_RATE) return value_hermite(h, l, tick, ahead, value);
    if (h->relation == ALONE) return value_first_order(h, l, tick, ahead, value);
    const double *v = h->samples + last * h->width, *v1 = v - h->width, *x = v + h->n, *x1 = v1 + h->n;
    const double ticks = (double)(t[0] - t[-1]), H = ticks * second, r = (past + ticks) / ticks;
    for (int64_t k = 0; k < h->n; k++)
        value[k] = 6 * r * (1 - r) * (x[k] - x1[k]) / H + (1 - r) * (1 - 3 * r) * v1[k] + r * (3 * r - 2) * v[k];
    return 0;
}
