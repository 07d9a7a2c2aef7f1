/* The check of steps: step_check.py in C. */

#include "loop.h"

#include <math.h>
#include <string.h>

typedef int (*SetState)(void *, void *);

/* Whether this is the first step or the last one changed the outputs by more than those before:
 * StepCheck._moved. */
static int moved(const Check *c, const double *outputs) {
    for (int64_t i = 0; i < c->n; i++) {
        const int64_t k = c->ports[i];
        const double change = fabs(outputs[c->rates[i]] - c->last[i]);
        if (!(change <= c->jump * c->jumps[k] || change <= c->share * c->scales[k])) return 1;
    }
    return 0;
}

static void note_rates(Check *c, const double *outputs, int jumped) {
    for (int64_t i = 0; i < c->n; i++) {
        const int64_t k = c->ports[i];
        const double rate = outputs[c->rates[i]], change = fabs(rate - c->last[i]);
        const double size = fmax(fabs(rate), c->at_rest * fabs(outputs[c->bases[i]]));
        if (jumped && change > c->jumps[k]) c->jumps[k] = change;
        if (size > c->scales[k]) c->scales[k] = size;
        c->last[i] = rate;
    }
}

/* The largest differences of the outputs from `halves`, by port, unless one is not finite. */
static void compare(Check *c, const double *outputs, double time, double end, double weight) {
    double *largest = c->errors + *c->count * c->n_ports;
    for (int64_t k = 0; k < c->n_ports; k++) largest[k] = 0.0;
    for (int64_t i = 0; i < c->n; i++) {
        const double apart = fabs(outputs[c->rates[i]] - c->halves[c->rates[i]]);
        if (!isfinite(apart)) return;
        if (apart > largest[c->ports[i]]) largest[c->ports[i]] = apart;
    }
    c->weights[*c->count] = weight;
    c->times[(*c->count)++] = time;
    if (end - time > *c->size) *c->size = end - time;
}

/* A step, and before it, where it is due, the same in two halves: step_check.py, which does it
 * where there is no room left. */
int fmu_checked_step(Fmu *f, double time, double end, double size, At *at) {
    Check *c = f->check;
    if (f->place->waiting <= time) return CALL;
    const int regular = (*c->steps + 1) % c->every == c->first, jumped = moved(c, f->outputs);
    const int due = regular || jumped;
    if (due && (f->place->ended || *c->count == c->room)) return CALL;
    if (due && !fmu_succeeded(fmu_save(f, c->get_state, c->state))) return CALL;
    note_rates(c, f->outputs, jumped);
    ++*c->steps;
    if (!due) return fmu_step(f, time, end, size, at);
    const size_t bytes = f->n_outputs * sizeof(double);
    const double half = (end - time) / 2;
    memcpy(c->before, f->outputs, bytes);
    const int halved = fmu_succeeded(fmu_do_step(f, time, half))
                       && fmu_succeeded(fmu_do_step(f, time + half, half)) && !fmu_get(f, 0, at);
    if (halved) memcpy(c->halves, f->outputs, bytes);
    f->place->rollbacks++;
    f->place->setter = 0;
    at->status = ((SetState)c->set_state)(f->fmu, *(void **)c->state);
    int code = !fmu_succeeded(at->status) ? UNRESTORED : fmu_step(f, time, end, size, at);
    if (!code && !(code = fmu_get(f, 0, at)) && halved)
        compare(c, f->outputs, time, end, regular ? (double)c->every : 1.0);
    memcpy(f->outputs, c->before, bytes);
    return code;
}
