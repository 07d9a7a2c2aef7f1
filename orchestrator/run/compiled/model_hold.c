/* A hold that knows how its signal depends on what the source reads of the target's side: at the newest sample's
 * q_n it goes on along the gradient to the coordinates q of the moment,
 *
 *     y = y_n + G_n (q - q_n).
 *
 * Behind the n entries y_n of a sample are q_n (m) and G_n (n x m), row by row. Whatever the age of the sample, the
 * error is of the second order in q - q_n. */

#include "loop.h"
#include "hold_table.h"

int value_model(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    const int64_t n = h->n, m = h->coordinates.n;
    const double *y = h->samples + (h->count - 1) * h->width, *q = y + n, *G = q + m;
    (void)tick;
    (void)ahead;
    for (int64_t i = 0; i < n; i++) {
        double moved = 0.0;
        for (int64_t j = 0; j < m; j++) moved += G[i * m + j] * (reading(&h->coordinates, l->values, j) - q[j]);
        value[i] = y[i] + moved;
    }
    return 0;
}
