/* Real time: when an event is due, and how late and how long it was. orchestrator/run/pace.py has the
 * definitions. */

#include "loop.h"

enum { BINS = 2304 };

/* Bins of a histogram (ns): 64 to each power of two. */
static int64_t bin(int64_t ns) {
    if (ns < 64) return ns > 0 ? ns : 0;
    const int64_t shift = 57 - __builtin_clzll((uint64_t)ns), i = 64 * shift + (ns >> shift);
    return i < BINS ? i : BINS - 1;
}

static int64_t due(const Loop *l, const Pace *p, int64_t tick) {
    return p->origin + (int64_t)(1e9 * tick_time(l, tick) / p->speed);
}

/* Waits until a tick is due; PAUSE where Python is to have its turn first. */
int pace_wait(const Loop *l, Events *e, int64_t tick) {
    Pace *p = e->pace;
    const int64_t until = due(l, p, tick);
    for (int64_t time; (time = p->clock()) < until;) {
        const int far = e->patience && until - time > e->patience;
        const int64_t turn = far ? e->since + e->patience : INT64_MAX;
        if (time >= turn || signal_came()) {
            e->since = time;
            return PAUSE;
        }
        p->wait(turn < until ? turn : until);
    }
    if (tick > p->reached) p->reached = tick;
    return 0;
}

/* Hardware does not get the ticks that it has missed one right after the other: the haptic clock's
 * next communication point is the first one that is not past, or the run's last. STARTS where its
 * window ends before that. */
int pace_skip(const Loop *l, Events *e) {
    Clock *c = e->clocks;
    const int64_t time = e->pace->clock();
    if (time - due(l, e->pace, c->starts[c->at]) > e->pace->most) return 0; /* the schedule moves */
    while (c->starts[c->next] < e->end && due(l, e->pace, c->starts[c->next]) <= time) {
        if (c->next + 1 == c->n) {
            e->at.what = 0;
            return STARTS;
        }
        c->next++;
    }
    return 0;
}

/* The haptic clock's event begins. */
void pace_begin(const Loop *l, Events *e) {
    Pace *p = e->pace;
    const Clock *c = e->clocks;
    p->begun = p->clock();
    p->due = due(l, p, e->tick);
    p->deadline = due(l, p, c->starts[c->at + 1]);
    const int64_t skipped = c->next - c->at - 1;
    p->ticks += skipped;
    p->missed += skipped;
    p->skipped += skipped;
    const int64_t late = p->begun - p->due;
    p->lateness[bin(late)]++;
    if (late > p->latest) p->latest = late;
    if (late <= p->most) return;
    p->origin += late;
    p->moved += late;
}

/* It is complete; its deadline is the next one's beginning. */
void pace_end(const Loop *l, Events *e, int64_t time) {
    Pace *p = e->pace;
    const int64_t took = time - p->begun;
    p->steps[bin(took)]++;
    if (took > p->longest) p->longest = took;
    p->missed += time > p->deadline;
    p->ticks++;
}
