/* What is changed of a scene that runs, between two events: the rate of a clock, the hold of a connection.
 * Inputs and parameters are set by the FMI functions of their FMUs. */

#include "loop.h"

#include <math.h>

/* The end of the step after the one that ends at `before`. */
static int64_t next_point(Rate *r, int64_t before) {
    r->tick += r->ticks;
    r->part += r->rest;
    if (r->part >= r->parts) {
        r->part -= r->parts;
        r->tick++;
    }
    int64_t point = r->tick + (r->part > 0);
    if (r->jitter > 0.0) {
        const double step = (double)r->ticks + (double)r->rest / (double)r->parts;
        const double late = r->jitter * (uniform(&r->generator) - 0.5) * step;
        point = r->tick + (int64_t)ceil((double)r->part / (double)r->parts + late);
    }
    const int64_t first = before / r->haptic + 1, whole = (point + r->haptic - 1) / r->haptic;
    return (whole > first ? whole : first) * r->haptic;
}

int further_points(Clock *c) {
    int64_t *starts = (int64_t *)c->starts;
    if (!c->rate.parts) return 0;
    starts[0] = starts[c->at];
    c->at = 0;
    for (int64_t i = 1; i < c->n; i++) starts[i] = next_point(&c->rate, starts[i - 1]);
    return 1;
}

/* From the end of the current step of a clock on; before the start, from t = 0 on. */
void hapticlink_change_rate(Clock *c, const Rate *rate) {
    c->rate = *rate;
    c->rate.tick = c->starts[c->at];
    c->rate.part = 0;
    further_points(c);
}

/* A hold in a place among those of the loop begins with the newest sample of its source, of tick `stamp`. GROW where
 * it has no room. */
int hapticlink_change_hold(Loop *l, int64_t place, Hold *h, int64_t stamp) {
    h->published = l->holds[place]->published;
    h->describes = l->holds[place]->describes;
    l->holds[place] = h;
    return push_sample(l, h, stamp, stamp);
}
