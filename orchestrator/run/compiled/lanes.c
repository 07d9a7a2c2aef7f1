/* Runs of one plan side by side, event by event, with the step of an FMU in all of them at once.
 *
 * They share kinds and times of events, and differ in what the FMUs' numbers are. Between two steps
 * that are taken at once each run carries out its operations as if it were alone. What is due in one of
 * them alone is done in it alone: a step that is checked, and one that a StepOfLanes does not take. */

#include "loop.h"

/* Operations of a run before number `stop`. */
static int go_on(const Lanes *s, int64_t lane, int64_t stop) {
    Events *e = s->events[lane];
    const int64_t last = e->at.last;
    e->at.last = stop;
    const int code = hapticlink_block(s->loops[lane], &e->at, e->tick);
    e->at.last = last;
    return code;
}

/* The next of a run's steps that are taken at once, or the end of its event. */
static int64_t next_stop(const Lanes *s, int64_t lane) {
    const Loop *l = s->loops[lane];
    const At *at = &s->events[lane]->at;
    for (int64_t i = at->op; i < at->last; i++)
        if (l->ops[i].code == STEP && s->steps[l->ops[i].a]) return i;
    return at->last;
}

/* Whether Python has something to do before a step. */
static int needs_python(const Fmu *f, int64_t parts, double time) {
    const int full = parts == 1 && f->check && *f->check->count == f->check->room;
    return f->place->waiting <= time || f->place->ended || full;
}

/* A run goes on behind a step, unless that gave a code. */
static void note(Lanes *s, int64_t lane, int code) {
    s->waiting[lane] = code;
    if (!code) s->events[lane]->at.op++;
}

/* Operation `number`, a step, in all runs that stand at it. */
static void take_step(Lanes *s, int64_t number) {
    const Op *op = s->loops[0]->ops + number;
    void *instances[MOST_LANES] = {NULL}; /* each in its own lane */
    int64_t taken[MOST_LANES], n = 0;
    StepTimes t = {.first = INT64_MIN};
    locate_step(s->loops[0], op, s->events[0]->tick, &t);
    for (int64_t i = 0; i < s->n; i++) {
        Fmu *f = s->loops[i]->fmus + op->a;
        At *at = &s->events[i]->at;
        if (at->op != number) continue;
        if (needs_python(f, op->c, t.begin)) {
            note(s, i, go_on(s, i, number + 1));
            continue;
        }
        const int due = op->c == 1 && f->check ? hapticlink_check_due(f->check, f->outputs) : 0;
        if (due) {
            note(s, i, fmu_step_with_halves(f, t.begin, t.end, op->x, due, at));
            continue;
        }
        fmu_begin_step(f, t.begin, t.end, op->x);
        instances[i] = f->fmu;
        n++;
    }
    if (!n) return;
    const int64_t begin = now();
    ((StepOfLanes *)s->steps[op->a])(instances, s->n, t.begin, op->x, taken);
    const int64_t took = (now() - begin) / n;
    keep_arithmetic(s->loops[0]->fmus[op->a].place); /* of the whole process */
    for (int64_t i = 0; i < s->n; i++) {
        Fmu *f = s->loops[i]->fmus + op->a;
        At *at = &s->events[i]->at;
        if (!instances[i]) continue;
        if (!taken[i]) {
            note(s, i, fmu_step(f, t.begin, t.end, op->x, at));
            continue;
        }
        f->place->steps++;
        note(s, i, fmu_end_step(f, 0, took, at));
    }
}

/* The first code that waits to be returned. */
static int first_code(Lanes *s) {
    for (int64_t i = 0; i < s->n; i++) {
        const int code = (int)s->waiting[i];
        if (!code) continue;
        s->waiting[i] = 0;
        s->lane = i;
        return code;
    }
    return 0;
}

/* As hapticlink_events, for all runs; the code returned is of run `lane`, DONE of all of them. */
int hapticlink_lanes(Lanes *s) {
    note_arithmetic();
    for (;;) {
        int code = first_code(s);
        if (code) return code;
        int64_t stop = INT64_MAX;
        for (int64_t i = 0; i < s->n; i++) {
            At *at = &s->events[i]->at;
            if (at->op < 0) {
                code = next_event(s->loops[i], s->events[i]);
                if (code == DONE) return DONE;
                if (code > 0) {
                    s->waiting[i] = code;
                    continue;
                }
            }
            s->waiting[i] = go_on(s, i, next_stop(s, i));
            if (at->op < at->last && at->op < stop) stop = at->op;
        }
        if ((code = first_code(s))) return code;
        if (stop < INT64_MAX) {
            take_step(s, stop);
            continue;
        }
        for (int64_t i = 0; i < s->n; i++) complete_event(s->events[i]);
        if (turn_is_due_by_now(s->events[0])) {
            s->lane = 0;
            return PAUSE;
        }
    }
}
