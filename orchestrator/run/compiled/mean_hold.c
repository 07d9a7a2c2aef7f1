/* Mean of the source since the target last read it, for a fast source and a slow target:
 *
 * (1/(b - a)) integral from a to b of y dt, y linear between samples; a is the newest stamp at the
 * previous reading, b the newest stamp now.
 *
 * What happens between two frames is not lost. Delayed by half a period in addition to the half period
 * of the hold itself; order 1. Without a new sample the value does not change.
 *
 * memory: newest, held, sum; arrival: the newest stamp; span: ticks in the sum, interval: the last of
 * these. */

#include "loop.h"
#include "hold_table.h"

#include <string.h>

int push_mean(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    double *newest = h->memory, *held = newest + h->n, *sum = held + h->n;
    (void)arrival;
    if (h->begun && stamp > h->arrival) {
        h->interval = stamp - h->arrival;
        for (int64_t k = 0; k < h->n; k++) sum[k] += (newest[k] + y[k]) * ((double)h->interval / 2);
        h->span += h->interval;
    } else if (h->span) { /* in place of the newest sample, the end of the last interval */
        for (int64_t k = 0; k < h->n; k++) sum[k] += (y[k] - newest[k]) * ((double)h->interval / 2);
    } else if (!h->interval) {
        memcpy(held, y, h->n * sizeof *y);
    }
    h->begun = 1;
    h->arrival = stamp;
    memcpy(newest, y, h->n * sizeof *y);
    return 0;
}

int value_mean(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    double *held = h->memory + h->n, *sum = held + h->n;
    (void)l, (void)tick, (void)ahead;
    if (h->span) {
        for (int64_t k = 0; k < h->n; k++) {
            held[k] = sum[k] / (double)h->span;
            sum[k] = 0.0;
        }
        h->span = 0;
    }
    memcpy(value, held, h->n * sizeof *value);
    return 0;
}

/* y + (y - mean)/2 of the newest sample y and the mean of the last frame, for an effort that acts on the target over a frame.
 *
 * The mean is of H/2 before the frame begins, so that y + c (y - mean) is of c H/2 behind that. With c = 1, the middle of
 * the frame, whatever of the effort depends on the target is fed back at full strength, a frame late; half of it is what
 * stays stable. */
int value_half_lead(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    const double *newest = h->memory;
    value_mean(h, l, tick, ahead, value);
    for (int64_t k = 0; k < h->n; k++) value[k] = newest[k] + (newest[k] - value[k]) / 2;
    return 0;
}
