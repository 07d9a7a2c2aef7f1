/* The order of events. In real time each begins when it is due,
 * and that of a clock whose steps are taken in a thread once they are done: concurrent_fmus.py. */

#include "loop.h"

static int busy(const Clock *c) { return c->side && c->side->started != c->side->done; }

static int awaited(const Clock *c) { return c->side && c->side->awaited; }

/* The tick of the next event; past the end, that of the next haptic tick while steps are awaited, or
 * INT64_MAX. */
static int64_t next_tick(const Events *e) {
    int64_t tick = INT64_MAX;
    int waits = 0;
    for (int64_t i = 0; i < e->n_clocks; i++) {
        const Clock *c = e->clocks + i;
        const int64_t start = c->starts[c->at];
        if (awaited(c))
            waits |= start <= e->end;
        else if (start < tick)
            tick = start;
    }
    if (tick <= e->end) return tick;
    if (!waits) return INT64_MAX;
    const int64_t reached = e->pace->reached > e->end ? e->pace->reached : e->end;
    return reached + e->clocks->starts[e->clocks->at] - e->end;
}

static int is_kind(const Events *e, int64_t kind) {
    if (kind >= e->n_kinds) return 0;
    const int64_t *key = e->keys + kind * (1 + e->n_clocks);
    for (int64_t i = 0; i <= e->n_clocks; i++)
        if (key[i] != e->key[i]) return 0;
    return 1;
}

/* The kind of the event at e->tick of those clocks that `fires` (2 dticks + final, from their `next`
 * communication point): e->key. */
static int find_kind(Loop *l, Events *e) {
    e->key[0] = e->tick == 0;
    for (int64_t i = 0; i < e->n_clocks; i++) {
        const Clock *c = e->clocks + i;
        const int64_t start = c->starts[c->at], after = c->next > c->at ? c->starts[c->next] : 0;
        e->key[1 + i] = after ? 2 * (after - start) + (after > e->end) : 0;
    }
    l->late = e->pace && e->pace->reached > e->tick ? e->pace->reached - e->tick : 0;
    if (!is_kind(e, e->kind)) { /* most events are of the kind of the one before */
        for (e->kind = 0; e->kind < e->n_kinds; e->kind++)
            if (is_kind(e, e->kind)) break;
        if (e->kind == e->n_kinds) return KIND;
    }
    const Block *b = e->kinds + e->kind;
    e->at.op = b->first;
    e->at.last = b->last;
    if (e->pace && e->key[1]) pace_begin(l, e);
    return -1;
}

static int turn_is_due(Events *e, int64_t time) {
    if (time - e->since < e->patience && !signal_came()) return 0;
    e->since = time;
    return 1;
}

enum { STRIDE = 64 };

/* The same, without a pace. Reading the clock takes as long as the events of small FMUs, so that it is
 * read once in `stride` events, of which there are more the shorter they are. */
int turn_is_due_by_now(Events *e) {
    const int signalled = signal_came();
    if (!signalled && ++e->unread < e->stride) return 0;
    const int64_t time = now(), took = time - e->read;
    if (took > e->patience / 16)
        e->stride = 1;
    else if (e->stride < STRIDE)
        e->stride = e->stride ? 2 * e->stride : 1;
    e->unread = 0;
    e->read = time;
    if (!signalled) return turn_is_due(e, time);
    e->since = time;
    return 1;
}

/* An awaited step that is done: its clock's event, alone, `late` by now. */
static int late_event(Loop *l, Events *e) {
    for (int64_t i = 0; i < e->n_clocks; i++) {
        Clock *c = e->clocks + i;
        const int64_t start = c->starts[c->at];
        if (!awaited(c) || busy(c) || start > e->end) continue;
        e->tick = start;
        c->next = c->at + 1;
        while (c->side->longer && c->starts[c->next] <= e->pace->reached && c->next + 1 < c->n) c->next++;
        return find_kind(l, e);
    }
    return 0;
}

/* The next event: e->tick and e->key (whether it is the first; 2 dticks + final of each clock that
 * fires, 0 of the others). DONE after the last. */
int next_event(Loop *l, Events *e) {
    for (;;) {
        for (int64_t i = 0; i < e->n_clocks; i++) {
            Clock *c = e->clocks + i;
            if (c->at + 1 >= c->n && !further_points(c)) {
                e->at.what = i;
                return STARTS;
            }
            c->next = c->at;
        }
        const int64_t tick = next_tick(e);
        if (tick == INT64_MAX) return DONE;
        if (e->halt && tick >= e->halt) return HALT;
        if (e->pace) {
            const int code = pace_wait(l, e, tick);
            const int late = code ? code : late_event(l, e);
            if (late) return late;
        }
        int fires = 0;
        for (int64_t i = 0; i < e->n_clocks; i++) {
            Clock *c = e->clocks + i;
            if (c->starts[c->at] != tick || tick > e->end || awaited(c)) continue;
            if (busy(c)) {
                c->side->awaited = 1;
            } else {
                c->next = c->at + 1;
                fires = 1;
            }
        }
        if (e->pace && e->pace->skips && e->clocks->next > e->clocks->at) {
            const int code = pace_skip(l, e);
            if (code) return code;
        }
        e->tick = tick;
        if (fires) return find_kind(l, e);
        if (turn_is_due(e, e->pace->clock())) return PAUSE;
    }
}

void complete_event(Events *e) {
    for (int64_t i = 0; i < e->n_clocks; i++) {
        Clock *c = e->clocks + i;
        if (c->next == c->at) continue;
        c->at = c->next;
        c->last = c->starts[c->at - 1];
        if (c->side) c->side->awaited = 0;
    }
    e->events++;
    e->at.op = -1;
}

/* Runs events until there are none left (DONE), `patience` ns have passed `since` the last PAUSE or a
 * signal has come, or Python is needed. e->at.op is -1 between events. */
int hapticlink_events(Loop *l, Events *e) {
    note_arithmetic();
    for (;;) {
        if (e->at.op < 0) {
            const int code = next_event(l, e);
            if (code >= 0) return code;
        }
        const int code = hapticlink_block(l, &e->at, e->tick);
        if (code != DONE) return code;
        complete_event(e);
        if (!e->pace) {
            if (turn_is_due_by_now(e)) return PAUSE;
            continue;
        }
        const int64_t time = e->pace->clock();
        if (e->key[1]) pace_end(l, e, time);
        if (turn_is_due(e, time)) return PAUSE;
    }
}
