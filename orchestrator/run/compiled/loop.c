/* The event loop: carries out the operations of a plan and calls the FMUs.
 *
 * It returns to Python for whatever it cannot do (see the codes in loop.h); Python does that and
 * calls it again where it stopped. Times are ticks; a tick is numerator/denominator s, and the
 * products below are below 2^53, so that each quotient is rounded once.
 */

#include "loop.h"

#include <math.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { WARNING = 1 };
enum { SHORT = 10000, ALL = 64, EACH = 64 };
/* Steps below SHORT ns, after ALL steps that were all timed, are timed one in EACH: reading the
 * clock takes longer than the shortest steps. */

static double seconds(const Loop *l, int64_t tick) {
    return (double)tick * l->numerator / l->denominator;
}

/* --- FMUs ------------------------------------------------------------------------------------- */

typedef int (*Transfer2)(void *, const uint32_t *, size_t, void *);
typedef int (*Transfer3)(void *, const uint32_t *, size_t, void *, size_t);
typedef int (*DoStep2)(void *, double, double, int);
typedef int (*DoStep3)(void *, double, double, _Bool, uint8_t *, uint8_t *, uint8_t *, double *);
typedef int (*GetState)(void *, void *);
typedef int (*SetState)(void *, void *);

static int transferred(const Transfer *t) {
    if (t->kind.fmi == 2)
        return ((Transfer2)t->call)(t->fmu, t->references, t->n_references, t->buffer);
    return ((Transfer3)t->call)(t->fmu, t->references, t->n_references, t->buffer, t->n);
}

/* Doubles from what the FMU has given; 0 where a number of 64 bits may not be exact as one. */
static int from_buffer(const Transfer *t) {
    const double exact = 9007199254740992.0;
#define FROM(kind, type)                                                                           \
    case kind:                                                                                     \
        for (int64_t i = 0; i < t->n; i++) t->values[i] = (double)((type *)t->buffer)[i];          \
        break;
    switch (t->kind.type) {
    case DOUBLE: return 1;
        FROM(FLOAT, float)
        FROM(INT64, int64_t)
        FROM(INT32, int32_t)
        FROM(INT16, int16_t)
        FROM(INT8, int8_t)
        FROM(UINT64, uint64_t)
        FROM(UINT32, uint32_t)
        FROM(UINT16, uint16_t)
        FROM(UINT8, uint8_t)
        FROM(BOOL2, int32_t)
        FROM(BOOL3, uint8_t)
    }
    if (t->kind.type == INT64 || t->kind.type == UINT64)
        for (int64_t i = 0; i < t->n; i++)
            if (fabs(t->values[i]) >= exact) return 0;
    return 1;
}

/* The nearest numbers of the FMU's type; 0 where one is beyond its range. */
static int to_buffer(const Transfer *t) {
#define TO(kind, type, least, beyond)                                                              \
    case kind:                                                                                     \
        for (int64_t i = 0; i < t->n; i++) {                                                       \
            const double whole = rint(t->values[i]);                                               \
            if (!(whole >= least && whole < beyond)) return 0;                                     \
            ((type *)t->buffer)[i] = (type)whole;                                                  \
        }                                                                                          \
        break;
    switch (t->kind.type) {
    case FLOAT:
        for (int64_t i = 0; i < t->n; i++) ((float *)t->buffer)[i] = (float)t->values[i];
        break;
        TO(INT64, int64_t, -9223372036854775808.0, 9223372036854775808.0)
        TO(INT32, int32_t, -2147483648.0, 2147483648.0)
        TO(INT16, int16_t, -32768.0, 32768.0)
        TO(INT8, int8_t, -128.0, 128.0)
        TO(UINT64, uint64_t, 0.0, 18446744073709551616.0)
        TO(UINT32, uint32_t, 0.0, 4294967296.0)
        TO(UINT16, uint16_t, 0.0, 65536.0)
        TO(UINT8, uint8_t, 0.0, 256.0)
    case BOOL2:
        for (int64_t i = 0; i < t->n; i++) ((int32_t *)t->buffer)[i] = t->values[i] >= 0.5;
        break;
    case BOOL3:
        for (int64_t i = 0; i < t->n; i++) ((uint8_t *)t->buffer)[i] = t->values[i] >= 0.5;
        break;
    }
    return 1;
}

/* Call number i of a get or a set. */
static inline int call(const Transfer *t, int64_t i, int64_t *count, At *at) {
    ++*count;
    at->what = i;
    at->status = transferred(t);
    if (t->kind.python && exception_left()) return RAISED;
    return at->status > WARNING ? FAILED : 0;
}

static int get(const Fmu *f, int64_t judged, At *at) {
    const Transfer *gets = *f->due ? f->gets : f->fewer;
    const int64_t n = *f->due ? f->n_gets : f->n_fewer;
    for (int64_t i = 0; i < n; i++) {
        const int code = call(gets + i, i, &f->place->gets, at);
        if (code) return code;
        if (gets[i].kind.type != DOUBLE && !from_buffer(gets + i)) return CALL;
    }
    if (!judged) return 0;
    int kept = 1;
    for (int64_t i = 0; i < f->n_outputs; i++)
        kept &= fabs(f->outputs[i]) * f->inverse[i] <= 1.0;
    if (!kept) return JUDGE;
    if (f->good) memcpy(f->good, f->outputs, f->n_outputs * sizeof(double));
    return 0;
}

/* Whether a value differs from the one before in any bit, and is now that. */
static inline int differs(double *before, double value) {
    int64_t bits[2];
    memcpy(bits, before, sizeof *before);
    memcpy(bits + 1, &value, sizeof value);
    *before = value;
    return bits[0] != bits[1];
}

static int set(const Setter *s, const double *board, At *at) {
    Place *p = s->place;
    if (p->ended) return 0;
    int differ = !s->key || p->setter != s->key;
    if (s->factors)
        for (int64_t i = 0; i < s->n; i++)
            differ |= differs(s->values + i, board[s->where[i]] * s->factors[i] + s->offsets[i]);
    else
        for (int64_t i = 0; i < s->n; i++) differ |= differs(s->values + i, board[s->where[i]]);
    if (!differ) return 0;
    if (s->into)
        for (int64_t i = 0; i < s->n; i++) s->whole[s->into[i]] = s->values[i];
    p->setter = 0;
    for (int64_t i = 0; i < s->n_sets; i++) {
        if (s->sets[i].kind.type != DOUBLE && !to_buffer(s->sets + i)) return CALL;
        const int code = call(s->sets + i, i, &p->sets, at);
        if (code) return code;
    }
    p->setter = s->key;
    return 0;
}

static int do_step(const Fmu *f, double time, double size) {
    f->place->steps++;
    if (f->kind.fmi == 2) return ((DoStep2)f->do_step)(f->fmu, time, size, (int)f->forward);
    return ((DoStep3)f->do_step)(f->fmu, time, size, f->forward != 0, f->event, f->terminate,
                                 f->early, f->reached);
}

/* The status of saving an FMU's state. */
static int save(const Fmu *f, void *get_state, void *state) {
    f->place->saves++;
    return ((GetState)get_state)(f->fmu, state);
}

static int step(Fmu *f, double time, double end, double size, At *at) {
    Place *p = f->place;
    p->time = p->begin = time;
    p->size = size;
    p->end = end;
    if (p->ended || p->waiting) return CALL;
    if (f->get_state && (at->status = save(f, f->get_state, f->state)) > WARNING) return UNSAVED;
    const int timed = !f->sparse || f->n_steps % EACH == 0;
    const int64_t begin = timed ? now() : 0;
    at->what = -1;
    at->status = do_step(f, time, size);
    if (timed) p->step_time += 1e-9 * (double)(now() - begin) * (f->sparse ? EACH : 1);
    if (f->kind.python && exception_left()) return RAISED;
    if (++f->n_steps == ALL) f->sparse = p->step_time < 1e-9 * SHORT * ALL;
    if (at->status > WARNING || (f->kind.fmi == 3 && *f->terminate)) return STEPPED;
    p->time = end;
    return 0;
}

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
    double *found = c->errors + *c->count * c->n_ports;
    for (int64_t k = 0; k < c->n_ports; k++) found[k] = 0.0;
    for (int64_t i = 0; i < c->n; i++) {
        const double apart = fabs(outputs[c->rates[i]] - c->halves[c->rates[i]]);
        if (!isfinite(apart)) return;
        if (apart > found[c->ports[i]]) found[c->ports[i]] = apart;
    }
    c->weights[*c->count] = weight;
    c->times[(*c->count)++] = time;
    if (end - time > *c->size) *c->size = end - time;
}

/* A step, and before it, where it is due, the same in two halves: step_check.py, which does it
 * where there is no room left, or the FMU can be asked to repeat a step. */
static int checked_step(Fmu *f, double time, double end, double size, At *at) {
    Check *c = f->check;
    if (f->place->waiting) return CALL;
    const int regular = (*c->steps + 1) % c->every == c->first, jumped = moved(c, f->outputs);
    const int due = regular || jumped;
    if (due && (f->get_state || f->place->ended || *c->count == c->room)) return CALL;
    if (due && save(f, c->get_state, c->state) > WARNING) return CALL;
    note_rates(c, f->outputs, jumped);
    ++*c->steps;
    if (!due) return step(f, time, end, size, at);
    const size_t bytes = f->n_outputs * sizeof(double);
    const double half = (end - time) / 2;
    memcpy(c->before, f->outputs, bytes);
    const int halved = do_step(f, time, half) <= WARNING
                       && do_step(f, time + half, half) <= WARNING && !get(f, 0, at);
    if (halved) memcpy(c->halves, f->outputs, bytes);
    f->place->rollbacks++;
    f->place->setter = 0;
    at->status = ((SetState)c->set_state)(f->fmu, *(void **)c->state);
    int code = at->status > WARNING ? UNRESTORED : step(f, time, end, size, at);
    if (!code && !(code = get(f, 0, at)) && halved)
        compare(c, f->outputs, time, end, regular ? (double)c->every : 1.0);
    memcpy(f->outputs, c->before, bytes);
    return code;
}

/* --- meters ----------------------------------------------------------------------------------- */

static double entry(const Reader *r, const double *board, int64_t i) {
    const double value = board[r->where[i]];
    return r->factor ? r->factor[i] * value + r->offset[i] : value;
}

static void reading(const Reader *r, const double *board, double *into) {
    for (int64_t i = 0; i < r->n; i++) into[i] = entry(r, board, i);
}

/* Meter.sample; CALL where there is no room, which Python then makes. */
static int meter_sample(Meter *m, const double *board, int64_t stamp) {
    int64_t *count = m->counts;
    if (!*count || m->stamps[*count - 1] != stamp) {
        if (*count == m->room) return CALL;
        m->stamps[(*count)++] = stamp;
    }
    reading(&m->source, board, m->samples + (*count - 1) * m->source.n);
    return 0;
}

static int meter_move(Meter *m, const double *board, int64_t tick) {
    int64_t *count = m->counts + 1;
    if (*count && m->ticks[*count - 1] == tick) return 0;
    if (*count >= m->full) return CALL;
    m->ticks[*count] = tick;
    reading(&m->x, board, m->moves + *count * m->x.n);
    ++*count;
    return 0;
}

static void meter_feed(Meter *m, const double *board, double share) {
    const int64_t n = m->held.n, moves = m->counts[1];
    int64_t *count = m->counts + 2;
    const int fresh = *count < moves;
    double *row = m->efforts + (fresh ? *count : *count - 1) * n;
    for (int64_t i = 0; i < n; i++) {
        const double effort = entry(&m->held, board, i);
        const double part = share == 1.0 ? effort : effort * share;
        row[i] = fresh ? part : row[i] + part;
    }
    *count += fresh;
}

/* --- operations ------------------------------------------------------------------------------- */

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
    return hold_value(h, l, tick + l->late, ahead - (double)l->late, h->held);
}

static int blend(const Loop *l, const Op *op, int64_t tick) {
    Hold *h = l->holds[op->a];
    double *value = hold_scratch(h), *sum = h->held;
    for (int64_t k = 0; k < h->n; k++) sum[k] = 0.0;
    for (int64_t i = op->b; i < op->c; i++) {
        const double ahead = l->points[i][1] - (double)l->late;
        const int code = hold_value(h, l, tick + l->late, ahead, value);
        if (code) return code;
        for (int64_t k = 0; k < h->n; k++) sum[k] += l->points[i][0] * value[k];
    }
    return 0;
}

static int push(const Loop *l, Hold *h, int64_t stamp, int64_t arrival) {
    double *sample = hold_scratch(h);
    if (h->far) *h->credit = account_credit(h->far, l);
    for (int64_t k = 0; k < h->width; k++) sample[k] = l->values[h->sources[k]];
    return hold_push(h, sample, stamp, arrival);
}

/* CALL before the first row, and where the block is full. */
static int record(const Loop *l, Table *t, int64_t tick) {
    if (!*t->room) return CALL;
    if (*t->due && t->block) {
        if (*t->rows >= *t->room) return CALL;
        double *row = t->block + *t->rows * (1 + t->n);
        row[0] = seconds(l, tick);
        if (t->where)
            for (int64_t i = 0; i < t->n; i++) row[1 + i] = l->values[t->where[i]];
        else
            memcpy(row + 1, t->view, t->n * sizeof *row);
        ++*t->rows;
    }
    *t->reached = seconds(l, tick);
    *t->due = ++*t->count % t->every == 0;
    return 0;
}

/* Carries out the operations from at->op to at->last. Returns DONE, or a code for operation
 * at->op. */
static int carry_out(Loop *l, int64_t tick, At *at) {
    int64_t known[3] = {INT64_MIN, 0, 0}; /* start, end and parts of the step before */
    double begins = 0.0, ends = 0.0;
    for (; at->op < at->last; at->op++) {
        const Op *op = l->ops + at->op;
        int code = 0;
        switch (op->code) {
        case PYTHON: return CALL;
        case GET: code = get(l->fmus + op->a, op->b, at); break;
        case SET: code = set(l->setters + op->a, l->values, at); break;
        case STEP: {
            const int64_t start = tick * op->c + op->b, end = start + op->d;
            if (start != known[0] || end != known[1] || op->c != known[2]) {
                const double whole = l->denominator * (double)op->c;
                begins = (double)start * l->numerator / whole;
                ends = (double)end * l->numerator / whole;
                known[0] = start, known[1] = end, known[2] = op->c;
            }
            Fmu *f = l->fmus + op->a;
            code = (op->c == 1 && f->check ? checked_step : step)(f, begins, ends, op->x, at);
            break;
        }
        case PUSH: code = push(l, l->holds[op->a], tick + op->b, tick + l->late); break;
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

/* --- real time -------------------------------------------------------------------------------- */

enum { BINS = 2304 };

/* Bins of a histogram (ns): 64 to each power of two. */
static int64_t bin(int64_t ns) {
    if (ns < 64) return ns > 0 ? ns : 0;
    const int64_t shift = 57 - __builtin_clzll((uint64_t)ns), i = 64 * shift + (ns >> shift);
    return i < BINS ? i : BINS - 1;
}

static int64_t due(const Loop *l, const Pace *p, int64_t tick) {
    return p->origin + (int64_t)(1e9 * seconds(l, tick));
}

/* Waits until a tick is due; PAUSE where Python is to have its turn first. */
static int wait_for(const Loop *l, Events *e, int64_t tick) {
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
static void begin(const Loop *l, Events *e) {
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
static void end(const Loop *l, Events *e, int64_t time) {
    Pace *p = e->pace;
    const int64_t took = time - p->begun, period = (int64_t)(1e9 * seconds(l, e->key[1] / 2));
    p->steps[bin(took)]++;
    if (took > p->longest) p->longest = took;
    p->missed += time - p->due > period;
    p->ticks++;
}

/* --- events ----------------------------------------------------------------------------------- */

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

/* The kind of the event at e->tick of those clocks that `fires` (2 dticks + final, from their `next`
 * communication point): e->key. */
static int found(Loop *l, Events *e) {
    e->key[0] = e->tick == 0;
    for (int64_t i = 0; i < e->n_clocks; i++) {
        const Clock *c = e->clocks + i;
        const int64_t start = c->starts[c->at], after = c->next > c->at ? c->starts[c->next] : 0;
        e->key[1 + i] = after ? 2 * (after - start) + (after > e->end) : 0;
    }
    l->late = e->pace && e->pace->reached > e->tick ? e->pace->reached - e->tick : 0;
    const size_t width = (1 + e->n_clocks) * sizeof *e->key;
    for (e->kind = 0; e->kind < e->n_kinds; e->kind++)
        if (!memcmp(e->keys + e->kind * (1 + e->n_clocks), e->key, width)) break;
    if (e->kind == e->n_kinds) return KIND;
    const Block *b = e->kinds + e->kind;
    e->at.op = b->first;
    e->at.last = b->last;
    if (e->pace && e->key[1]) begin(l, e);
    return -1;
}

static int turn_is_due(Events *e, int64_t time) {
    if (time - e->since < e->patience && !signal_came()) return 0;
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
        return found(l, e);
    }
    return 0;
}

/* The next event: e->tick and e->key (whether it is the first; 2 dticks + final of each clock that
 * fires, 0 of the others). DONE after the last. */
static int next_event(Loop *l, Events *e) {
    for (;;) {
        for (int64_t i = 0; i < e->n_clocks; i++) {
            Clock *c = e->clocks + i;
            c->next = c->at;
            if (c->at + 1 >= c->n) {
                e->at.what = i;
                return STARTS;
            }
        }
        const int64_t tick = next_tick(e);
        if (tick == INT64_MAX) return DONE;
        if (e->pace) {
            const int code = wait_for(l, e, tick);
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
        e->tick = tick;
        if (fires) return found(l, e);
        if (turn_is_due(e, e->pace->clock())) return PAUSE;
    }
}

static void complete(Events *e) {
    for (int64_t i = 0; i < e->n_clocks; i++) {
        Clock *c = e->clocks + i;
        if (c->next > c->at && c->side) c->side->awaited = 0;
        c->at = c->next;
    }
    e->events++;
    e->at.op = -1;
}

/* Runs events until there are none left (DONE), `patience` ns have passed `since` the last PAUSE or a
 * signal has come, or Python is needed. e->at.op is -1 between events. */
EXPORT int hapticlink_events(Loop *l, Events *e) {
    for (;;) {
        if (e->at.op < 0) {
            const int code = next_event(l, e);
            if (code >= 0) return code;
        }
        const int code = carry_out(l, e->tick, &e->at);
        if (code != DONE) return code;
        complete(e);
        const int64_t time = e->pace ? e->pace->clock() : now();
        if (e->pace && e->key[1]) end(l, e, time);
        if (turn_is_due(e, time)) return PAUSE;
    }
}

EXPORT int64_t hapticlink_now(void) { return now(); }

EXPORT void hapticlink_wait(int64_t until) { wait_until(until); }

/* Whether to notice signals; Windows has none that Python would not notice. */
EXPORT void hapticlink_watch(int on) { watch_signals(on); }

/* PyGILState_Ensure, PyErr_Occurred and PyGILState_Release. */
EXPORT void hapticlink_python(int (*ensure)(void), void *(*occurred)(void), void (*release)(int)) {
    use_python(ensure, occurred, release);
}

/* Runs one sequence of operations at a tick, within an operation that Python carries out. */
EXPORT int hapticlink_block(Loop *l, At *at, int64_t tick) { return carry_out(l, tick, at); }

EXPORT int hapticlink_push(Hold *h, const double *sample, int64_t stamp, int64_t arrival) {
    return hold_push(h, sample, stamp, arrival);
}

EXPORT int hapticlink_value(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    return hold_value(h, l, tick, ahead, value);
}

/* The sizes of the structures, in the order of `structures.py`. */
EXPORT void hapticlink_sizes(int64_t *sizes) {
    const int64_t found[] = {
        sizeof(Place),  sizeof(Kind), sizeof(Transfer), sizeof(Check),  sizeof(Fmu),   sizeof(Setter),
        sizeof(Link),   sizeof(Tank), sizeof(Reader),   sizeof(Queue),  sizeof(Account),
        sizeof(Hold),   sizeof(Meter), sizeof(Table),   sizeof(Op),     sizeof(Side),
        sizeof(Clock),  sizeof(Pace), sizeof(Block),    sizeof(Loop),   sizeof(At),
        sizeof(Events)};
    memcpy(sizes, found, sizeof found);
}
