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
    return p->origin + (int64_t)(1e9 * tick_time(l, tick));
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

/* The haptic clock's event begins. */
void pace_begin(const Loop *l, Events *e) {
    Pace *p = e->pace;
    p->begun = p->clock();
    p->due = due(l, p, e->tick);
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
    const int64_t took = time - p->begun, period = (int64_t)(1e9 * tick_time(l, e->key[1] / 2));
    p->steps[bin(took)]++;
    if (took > p->longest) p->longest = took;
    p->missed += time - p->due > period;
    p->ticks++;
}
