/* A hold that knows how its signal depends on what the source reads of the target's side: from the newest sample it
 * goes on along the gradient, from the coordinates q_n at which that was computed to those of the moment, q:
 *
 *     y = y_n + s G_n (q - q_n).
 *
 * Behind the n entries y_n of a sample are q_n (m) and G_n (n x m), row by row. Whatever the age of the sample, the
 * error is of the second order in q - q_n while s is 1. Of a matrix the change is at most MOST of the sample, in Frobenius'
 * norm, of a semidefinite one in coordinates scaled by its diagonal: s is 1 or what makes it so. */

#include "loop.h"
#include "hold_table.h"

#include <math.h>

#define MOST 0.25 /* of .06 to 2 and none the best at 10 to 30 Hz, docs/holds.md */

static double size(const Hold *h, const double *matrix) {
    const int64_t rows = h->rows;
    double sum = 0.0;
    for (int64_t i = 0; i < rows; i++)
        for (int64_t j = 0; j < rows; j++) {
            const double scale = h->manifold == SEMIDEFINITE ? h->scale[i] * h->scale[j] : 1.0;
            const double entry = matrix[i * rows + j] / scale;
            sum += entry * entry;
        }
    return sqrt(sum);
}

int value_model(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    const int64_t n = h->n, m = h->beside.n;
    const double *y = h->samples + (h->count - 1) * h->width, *q = y + n, *G = q + m;
    (void)tick;
    (void)ahead;
    for (int64_t i = 0; i < n; i++) {
        value[i] = 0.0;
        for (int64_t j = 0; j < m; j++) value[i] += G[i * m + j] * (reading(&h->beside, l->values, j) - q[j]);
    }
    double s = 1.0;
    if (h->manifold) {
        const double most = MOST * size(h, y), change = size(h, value);
        if (change > most) s = most / change;
    }
    for (int64_t i = 0; i < n; i++) value[i] = y[i] + s * value[i];
    return 0;
}
