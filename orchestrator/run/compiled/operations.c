/* Carries out the operations of a plan at an event, and calls the FMUs.
 *
 * It returns to Python for whatever it cannot do (see the codes in loop.h); Python does that and
 * calls it again where it stopped. Times are ticks; a tick is numerator/denominator s, and the
 * products below are below 2^53, so that each quotient is rounded once.
 */

#include "loop.h"

#include <string.h>

static int compares(double value, int64_t comparison, double limit) {
    switch (comparison) {
    case 0: return value < limit;
    case 1: return value <= limit;
    case 2: return value > limit;
    case 3: return value >= limit;
    }
    return 0;
}

static int evaluate(const Loop *l, Hold *h, int64_t tick, double ahead) {
    return hapticlink_value(h, l, tick + l->late, ahead - (double)l->late, h->held);
}

static int blend(const Loop *l, const Op *op, int64_t tick) {
    Hold *h = l->holds[op->a];
    double *value = hold_scratch(h), *sum = h->held;
    for (int64_t k = 0; k < h->n; k++) sum[k] = 0.0;
    for (int64_t i = op->b; i < op->c; i++) {
        const double ahead = l->points[i][1] - (double)l->late;
        const int code = hapticlink_value(h, l, tick + l->late, ahead, value);
        if (code) return code;
        for (int64_t k = 0; k < h->n; k++) sum[k] += l->points[i][0] * value[k];
    }
    return 0;
}

/* The newest sample of the source of a hold. */
int push_sample(const Loop *l, Hold *h, int64_t stamp, int64_t arrival) {
    double *sample = hold_scratch(h);
    if (h->far) *h->credit = hapticlink_credit(h->far, l);
    for (int64_t k = 0; k < h->width; k++) sample[k] = l->values[h->sources[k]];
    return hapticlink_push(h, sample, stamp, arrival);
}

/* CALL before the first row, and where the block is full. */
static int record(const Loop *l, Table *t, int64_t tick) {
    if (!*t->room) return CALL;
    const double time = tick_time(l, tick);
    if (*t->due && t->block) {
        if (*t->rows >= *t->room) return CALL;
        double *row = t->block + *t->rows * (1 + t->n);
        row[0] = time;
        if (t->where)
            for (int64_t i = 0; i < t->n; i++) row[1 + i] = l->values[t->where[i]];
        else
            memcpy(row + 1, t->view, t->n * sizeof *row);
        ++*t->rows;
    }
    *t->reached = time;
    ++*t->count;
    *t->due = t->every == 1 || *t->count % t->every == 0 || *t->count == t->end;
    return 0;
}

/* Carries out the operations from at->op to at->last at a tick, for the loop or within an operation
 * of Python's. Returns DONE, or a code for operation at->op. */
int hapticlink_block(Loop *l, At *at, int64_t tick) {
    StepTimes step = {.first = INT64_MIN}; /* of the step before */
    for (; at->op < at->last; at->op++) {
        const Op *op = l->ops + at->op;
        int code = 0;
        switch (op->code) {
        case PYTHON: return CALL;
        case GET: code = fmu_get(l->fmus + op->a, op->b, at); break;
        case SET: code = fmu_set(l->setters + op->a, l->values, at); break;
        case STEP: {
            locate_step(l, op, tick, &step);
            Fmu *f = l->fmus + op->a;
            code = (op->c == 1 && f->check ? fmu_checked_step : fmu_step)(f, step.begin, step.end, op->x, at);
            break;
        }
        case PUSH: code = push_sample(l, l->holds[op->a], tick + op->b, tick + l->late); break;
        case EVALUATE: code = evaluate(l, l->holds[op->a], tick, op->x); break;
        case BLEND: code = blend(l, op, tick); break;
        case SAMPLE: code = meter_sample(l->meters[op->a], l->values, tick + op->b); break;
        case MOVE: code = meter_move(l->meters[op->a], l->values, tick + op->b); break;
        case FEED: meter_feed(l->meters[op->a], l->values, op->x); break;
        case RECORD: code = record(l, l->tables + op->a, tick); break;
        case STOP_WHEN:
            if (compares(l->values[op->a], op->b, op->x)) code = STOP;
            break;
        }
        if (code) return code;
    }
    return DONE;
}

/* Those of platform.c, which does without loop.h: windows.h has the same names for types. */
EXPORT int64_t hapticlink_now(void) { return now(); }

EXPORT void hapticlink_wait(int64_t until) { wait_until(until); }

/* Whether to notice signals; Windows has none that Python would not notice. */
EXPORT void hapticlink_watch(int on) { watch_signals(on); }
