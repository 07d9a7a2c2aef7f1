/* Estimates the integration error of plants during a run, by step doubling on a few of their steps.
 *
 * e_k = |v(t_k + h) - v_2(t_k + h)| / max |v|
 *
 * v are the outputs that are first derivatives of others, v_2 the same after two steps of h/2 from
 * the same FMU state with the same inputs (Hairer, Norsett, Wanner, Solving Ordinary Differential
 * Equations I (1993), section II.4, without the factor 1/(1 - 2^-p): a step may be too long for its
 * order p to show). e_k of about 1 is a step beyond the stability of its method, as with a stiff drive
 * at a light body. The sum of all e_k estimates what the errors of a run add up to where the motion
 * neither damps nor amplifies them.
 *
 * One step in EVERY is checked, so that EVERY e_k stands for the sum. Episodes that are shorter, such
 * as an impact or a light body that passes a dead centre, show in the change of v over a step: the
 * first step, and each after one that changed v by a multiple JUMP of all before, are checked, too,
 * and count once.
 *
 * The state is restored before the step that counts, so that results do not depend on the check. Only
 * FMUs with a hapticlink annotation are checked: others may keep what they do not restore. */

#include "loop.h"

#include <math.h>
#include <string.h>

typedef int (*SetState)(void *, void *);

#define SMALL 1e-3 /* m or rad: a mechanism that is not larger is taken to be so large */

/* Whether this is the first step (v before it is NaN) or the last one changed v by more than those before. */
static int moved(const Check *c, const double *outputs) {
    for (int64_t i = 0; i < c->n; i++) {
        const int64_t k = c->ports[i];
        const double change = fabs(outputs[c->rates[i]] - c->last[i]);
        if (!(change <= c->jump * c->jumps[k] || change <= c->share * c->scales[k])) return 1;
    }
    return 0;
}

static void note_rates(Check *c, const double *outputs, int jumped) {
    double extent = SMALL; /* of rounding that moves nothing, no share can be told */
    for (int64_t i = 0; i < c->n; i++) extent = fmax(extent, fabs(outputs[c->bases[i]]));
    for (int64_t i = 0; i < c->n; i++) {
        const int64_t k = c->ports[i];
        const double rate = outputs[c->rates[i]], change = fabs(rate - c->last[i]);
        const double size = fmax(fabs(rate), c->at_rest * extent);
        if (jumped && change > c->jumps[k]) c->jumps[k] = change;
        if (size > c->scales[k]) c->scales[k] = size;
        c->last[i] = rate;
    }
}

/* The largest differences of the outputs from `halves`, by port, unless one is not finite. */
void hapticlink_check(
    Check *c, const double *outputs, const double *halves, double time, double end, int regular
) {
    double *largest = c->errors + *c->count * c->n_ports;
    for (int64_t k = 0; k < c->n_ports; k++) largest[k] = 0.0;
    for (int64_t i = 0; i < c->n; i++) {
        const double apart = fabs(outputs[c->rates[i]] - halves[c->rates[i]]);
        if (!isfinite(apart)) return;
        if (apart > largest[c->ports[i]]) largest[c->ports[i]] = apart;
    }
    c->weights[*c->count] = regular ? (double)c->every : 1.0;
    c->times[(*c->count)++] = time;
    if (end - time > *c->size) *c->size = end - time;
}

/* Counts a step that begins at `outputs`: 0 where it is not checked, 1 where it is as one of the regular
 * ones, 2 after one that changed v. */
int hapticlink_check_due(Check *c, const double *outputs) {
    const int regular = (*c->steps + 1) % c->every == c->first, jumped = moved(c, outputs);
    note_rates(c, outputs, jumped);
    ++*c->steps;
    return regular ? 1 : jumped ? 2 : 0;
}

/* A step, and before it, where it is due, the same in two halves. GROW where there is no room left. */
int fmu_checked_step(Fmu *f, double time, double end, double size, At *at) {
    Check *c = f->check;
    if (f->place->waiting <= time) return SETTLE;
    if (f->place->ended) return CALL;
    if (*c->count == c->room) return GROW;
    const int due = hapticlink_check_due(c, f->outputs);
    return due ? fmu_step_with_halves(f, time, end, size, due, at) : fmu_step(f, time, end, size, at);
}

/* A step, and before it the same in two halves; `due`: as hapticlink_check_due. */
int fmu_step_with_halves(Fmu *f, double time, double end, double size, int due, At *at) {
    Check *c = f->check;
    if (!fmu_succeeded(at->status = fmu_save(f, c->get_state, c->state))) {
        at->what = -1;
        return UNSAVED;
    }
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
        hapticlink_check(c, f->outputs, c->halves, time, end, due == 1);
    memcpy(f->outputs, c->before, bytes);
    return code;
}
