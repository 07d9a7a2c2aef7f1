/* The FMI 2.0.5 co-simulation interface of a scene as one program.
 *
 * The run is the project's own loop (loop.h) on the data of scene.h, which Python has resolved; the
 * blocks are linked in, each with its FMI functions under its own prefix: those of fmus/native/fmi2.c,
 * or of an FMU of others (foreign.py).
 *
 *     fmi2DoStep   all events from where the program stands up to, but not at, the last tick at or
 *                  before the end of the step: what happens at a tick needs the inputs of that tick
 *     fmi2GetReal  an output of a block at its newest communication point that is not past the
 *                  program's: of the block itself, or of its clock's newest row while the block is
 *                  ahead, as slow ones are
 *     fmi2SetReal  inputs and parameters go to the block; those of the block that is left out stand
 *                  in the vector of signals
 *
 * State is one structure, whose pointers are written again when it is restored, and the states of the
 * blocks. Nothing is shared between instances. */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#include "loop.h"

typedef const fmi2ValueReference *References;

typedef enum { INPUT, OUTSIDE, PARAMETER, OUTPUT, ENERGY, STEP_ERROR } VariableKind;

typedef enum { REAL, INTEGER, BOOLEAN, STRING } VariableType; /* in its block; here all are numbers */

typedef struct {
    VariableKind kind;
    VariableType type;
    int member, fixed;
    fmi2ValueReference reference;
    int64_t place; /* in the vector of signals */
    const char *name;
} Variable;

/* A start value that a scene gives to a block of others. */
typedef struct {
    int member;
    VariableType type;
    fmi2ValueReference reference;
    double value;
    const char *text;
} Given;

/* A window of communication points begins again after `n` of them, `ticks` later. */
typedef struct {
    int64_t n, ticks;
} Pattern;

/* Kinds of events in which the changed clock takes steps of any length, others as in `key`: for one of
 * `dticks` the operations from `first` on, that grow with each tick by `slopes` from there on. */
typedef struct {
    int64_t first, n, dticks, slopes, key[8];
} Family;

/* The functions of a block that are called. */
#define FUNCTIONS(X, id)                                                                            \
    X(id, Instantiate, instantiate) X(id, FreeInstance, free) X(id, SetupExperiment, setup)         \
    X(id, EnterInitializationMode, enter) X(id, ExitInitializationMode, exit)                       \
    X(id, Terminate, terminate) X(id, Reset, reset) X(id, GetReal, get) X(id, SetReal, set)         \
    X(id, GetInteger, get_integer) X(id, SetInteger, set_integer)                                   \
    X(id, GetBoolean, get_boolean) X(id, SetBoolean, set_boolean) X(id, SetString, set_string)      \
    X(id, DoStep, step) X(id, GetBooleanStatus, boolean_status)                                     \
    X(id, GetRealStatus, real_status) X(id, GetFMUstate, get_state) X(id, SetFMUstate, set_state)   \
    X(id, FreeFMUstate, free_state) X(id, SerializedFMUstateSize, state_size)                       \
    X(id, SerializeFMUstate, serialize) X(id, DeSerializeFMUstate, deserialize)

#define FIELD(id, function, field) fmi2##function##TYPE *field;
typedef struct {
    const char *id, *name, *guid;
    double tolerance; /* 0 where there is none */
    FUNCTIONS(FIELD, )
} Member;

#include "scene.h"

#define DECLARE_ONE(id, function, field) extern fmi2##function##TYPE id##_fmi2##function;
#define DECLARE(id, name, guid, tolerance) FUNCTIONS(DECLARE_ONE, id)
MEMBERS(DECLARE)

#define NAME(id, function, field) id##_fmi2##function,
#define ROW(id, name, guid, tolerance) {#id, name, guid, tolerance, FUNCTIONS(NAME, id)},
static const Member members[] = {MEMBERS(ROW)};

enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP_MODE = 4, ENDED = 8, FAILURE = 16, TERMINATED = 32 };
enum { SWEEPS = 50 };
static const double TOLERANCE = 1e-12; /* of start values: run/initialize.py */
static const double GROWTH = 1e12;     /* of outputs without a bound: fmi/instance.py */
static const double SHARE = 1e-6;      /* of a step that is whole: fmi/status.py */
static const double NEAR = 1e-3;       /* of a tick, by which a time may be before it */

typedef struct { /* of the scene while it runs: prepared_changes.h */
    int64_t chosen[N_HOLDS + 1], direct[N_HOLDS + 1]; /* 1 + choice, 0: the scene's; without latency */
    int64_t round[N_CLOCKS], kinds; /* of the patterns of clocks; spare kinds so far */
} Changes;

typedef struct { /* what fmi2GetFMUstate saves, beside the states of the blocks */
    char guid[40];
    int64_t mode, settled, tick; /* settled: start values agree. tick: where the program stands */
    double time;
    double step_errors[N_FMUS][N_CHECKED + 1]; /* sums of the rows of step checks that are dropped */
    Changes changes;
    Scene scene;
} State;

typedef struct {
    State now;
    fmi2CallbackFunctions callbacks, member_callbacks;
    fmi2Component members[N_MEMBERS];
    fmi2FMUstate slots[N_SLOTS + 1]; /* states that the loop saves */
    double before[N_VALUES];
    double stop; /* INFINITY where none is defined */
    char name[];
} Model;

typedef struct {
    State now;
    fmi2FMUstate members[N_MEMBERS];
} Saved;

#include "fmi2_common.h"

/* --- messages ------------------------------------------------------------------------------- */

static const char *standing(const Model *m) {
    switch (m->now.mode) {
    case INSTANTIATED: return "is instantiated";
    case INITIALIZATION: return "is in initialisation mode";
    case STEP_MODE: return "is initialised";
    case ENDED: return "has ended the simulation";
    case FAILURE: return "has failed; reset it or restore a state";
    }
    return "is terminated";
}

static int has_ended(const Model *m) { return m->now.mode == ENDED; }

/* Messages of a block, with its name. */
static void member_logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                          fmi2String category, fmi2String message, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    fail(environment, status > fmi2Fatal ? fmi2OK : status, "%s: %s", name, text);
    (void)category;
}

/* --- the data of the scene ------------------------------------------------------------------- */

static void put(Model *m, size_t at, const void *pointer) {
    memcpy((char *)&m->now.scene + at, &pointer, sizeof pointer);
}

static void use_chosen(Model *m);

/* Writes all pointers of the scene: into itself, to the blocks and to their functions, the pointers of a
 * Member. */
static void relocate(Model *m) {
    for (int i = 0; i < N_POINTERS; i++)
        put(m, pointers[i].at, (char *)&m->now.scene + pointers[i].to);
    for (int i = 0; i < N_HANDLES; i++) put(m, handles[i].at, m->members[handles[i].member]);
    for (int i = 0; i < N_CALLS; i++)
        put(m, calls[i].at, *(void *const *)((const char *)(members + calls[i].member) + calls[i].function));
    for (int i = 0; i < N_SLOTS; i++) put(m, slots[i], m->slots + i);
    use_chosen(m);
}

static fmi2Status give(Model *m, const Given *g) {
    const Member *member = members + g->member;
    fmi2Component c = m->members[g->member];
    const int whole = (int)g->value;
    switch (g->type) {
    case REAL: return member->set(c, &g->reference, 1, &g->value);
    case INTEGER: return member->set_integer(c, &g->reference, 1, &whole);
    case BOOLEAN: return member->set_boolean(c, &g->reference, 1, &whole);
    default: return member->set_string(c, &g->reference, 1, &g->text);
    }
}

/* As the scene begins, with blocks that are as they are instantiated. */
static fmi2Status restart(Model *m) {
    memset(&m->now, 0, sizeof m->now);
    memcpy(m->now.guid, GUID, sizeof GUID);
    memcpy(&m->now.scene, &initial, sizeof initial);
    m->now.mode = INSTANTIATED;
    m->stop = INFINITY;
    relocate(m);
    for (int i = 0; i < N_SETTABLE; i++) {
        const Variable *v = variables + i;
        if (isnan(starts[i])) continue; /* the block has it by itself */
        if (v->kind == OUTSIDE) m->now.scene.loop_values[v->place] = starts[i];
        else if (members[v->member].set(m->members[v->member], &v->reference, 1, starts + i) > fmi2Warning)
            return fail(m, fmi2Error, "%s does not take its start value", v->name);
    }
    for (int i = 0; i < N_GIVEN; i++)
        if (give(m, given + i) > fmi2Warning)
            return fail(m, fmi2Error, "%s does not take its start values", members[given[i].member].name);
    return fmi2OK;
}

static double seconds(const Model *m, int64_t tick) { return tick_time(&m->now.scene.loop, tick); }

/* --- initialisation: orchestrator/run/initialize.py ------------------------------------------- */

static int agrees(double value, double before) {
    if (value == before || (isnan(value) && isnan(before))) return 1;
    return fabs(value - before) <= TOLERANCE + TOLERANCE * fabs(before);
}

static fmi2Status unsettled(const Model *m, int fmu) {
    return fail(m, fmi2Error, "%s gives no outputs or takes no inputs in initialisation",
                members[fmu_members[fmu]].name);
}

/* Sets inputs and reads outputs until they agree. */
static fmi2Status settle(Model *m) {
    Scene *s = &m->now.scene;
    Loop *l = &s->loop;
    At at = {0};
    int last = -1;
    if (m->now.settled) return fmi2OK;
    for (int i = 0; i < N_FMUS; i++)
        if (fmu_get(l->fmus + i, 0, &at)) return unsettled(m, i);
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        memcpy(m->before, l->values, sizeof m->before);
        for (int i = 0; i < N_START_SETTERS; i++) {
            for (int k = 0; k < N_HOLDS; k++)
                for (int64_t j = 0; j < l->holds[k]->n; j++)
                    l->holds[k]->held[j] = l->values[l->holds[k]->sources[j]];
            if (fmu_set(START_SETTERS(s) + i, l->values, &at)) return unsettled(m, start_fmus[i]);
            if (fmu_get(l->fmus + start_fmus[i], 0, &at)) return unsettled(m, start_fmus[i]);
        }
        last = -1;
        for (int i = 0; i < N_VALUES && last < 0; i++)
            if (!agrees(l->values[i], m->before[i])) last = i;
        if (last < 0) break;
    }
    if (last >= 0)
        return fail(m, fmi2Error, "%s does not settle in initialisation: %.17g after %.17g",
                    last < N_SIGNALS ? signals[last] : "a held value", l->values[last], m->before[last]);
    m->now.settled = 1;
    return fmi2OK;
}

static int are_finite(const Model *m) {
    const double *values = m->now.scene.loop.values;
    for (int i = 0; i < N_SIGNALS; i++)
        if (!isfinite(values[i]))
            return !fail(m, fmi2Error, "output %s is %.17g after initialisation", signals[i], values[i]);
    return 1;
}

/* Bounds of the outputs, and the samples of t = 0 for holds and meters. */
static int begin(Model *m) {
    Loop *l = &m->now.scene.loop;
    for (int i = 0; i < N_FMUS; i++) {
        const Fmu *f = l->fmus + i;
        double *inverse = (double *)f->inverse;
        const int64_t first = f->outputs - l->values;
        for (int64_t k = 0; k < f->n_outputs; k++) {
            const double start = fabs(f->outputs[k]), nominal = nominals[first + k];
            const double grown = GROWTH * (start >= nominal ? start : nominal);
            inverse[k] = 1.0 / (bounds[first + k] > 0.0 ? bounds[first + k] : grown);
        }
        if (f->good) memcpy(f->good, f->outputs, f->n_outputs * sizeof(double));
    }
    At at = {START_FIRST, START_LAST, 0, 0};
    return hapticlink_block(l, &at, 0);
}

#include "prepared_changes.h"

/* --- events ---------------------------------------------------------------------------------- */

static int64_t next_tick(const Events *e) {
    int64_t tick = INT64_MAX;
    for (int64_t i = 0; i < e->n_clocks; i++) {
        const Clock *c = e->clocks + i;
        if (c->starts[c->at] < tick) tick = c->starts[c->at];
    }
    return tick;
}

/* Adds the rows of step checks to their sums. */
static void add_step_errors(Model *m, int64_t fmu) {
    const Check *c = m->now.scene.loop.fmus[fmu].check;
    for (int64_t k = 0; k < *c->count; k++)
        for (int64_t i = 0; i < c->n_ports; i++)
            m->now.step_errors[fmu][i] += c->weights[k] * c->errors[k * c->n_ports + i];
    *c->count = 0;
}

static double step_error(const Model *m, int64_t fmu) {
    const Check *c = m->now.scene.loop.fmus[fmu].check;
    double largest = 0.0;
    for (int64_t i = 0; i < c->n_ports; i++) {
        double sum = m->now.step_errors[fmu][i];
        for (int64_t k = 0; k < *c->count; k++) sum += c->weights[k] * c->errors[k * c->n_ports + i];
        sum /= c->scales[i] > 0.0 ? c->scales[i] : 1.0;
        if (sum > largest) largest = sum;
    }
    return largest;
}

/* Outputs that are not finite, which are held where the scene asks for it, or beyond a bound: judge of
 * orchestrator/fmi/instance.py. */
static int judge(Model *m, Fmu *f) {
    const int64_t first = f->outputs - m->now.scene.loop.values;
    for (int64_t k = 0; k < f->n_outputs; k++) {
        if (!isfinite(f->outputs[k]) && f->good) f->outputs[k] = f->good[k];
        if (isfinite(f->outputs[k]) && fabs(f->outputs[k]) * f->inverse[k] <= 1.0) continue;
        fail(m, fmi2Error, "output %s is %.3g at t = %.6g s: the run has diverged; take a higher "
             "rate, a finer integrator, or weaker gains", signals[first + k], f->outputs[k],
             f->place->time);
        return 0;
    }
    if (f->good) memcpy(f->good, f->outputs, f->n_outputs * sizeof(double));
    return 1;
}

/* Whether a block has discarded a step because it ends the simulation there: it is then the last one
 * of the block. 0, with a message, where it failed or ends within the step: calls_of_fmi.py. */
static int took_its_last_step(Model *m, int64_t fmu, fmi2Status status) {
    const Member *member = members + fmu_members[fmu];
    fmi2Component c = m->members[fmu_members[fmu]];
    StepState *p = m->now.scene.loop.fmus[fmu].place;
    fmi2Boolean ends = fmi2False;
    double end;
    if (status != fmi2Discard || member->boolean_status(c, fmi2Terminated, &ends) || !ends) {
        fail(m, fmi2Error, "%s failed in its step from t = %.17g s", member->name, p->begin);
        return 0;
    }
    if (member->real_status(c, fmi2LastSuccessfulTime, &end)) end = p->begin;
    if (end >= p->begin + (1.0 - SHARE) * p->size) {
        p->ended = 1;
        p->time = p->end;
        return 1;
    }
    m->now.mode = ENDED;
    m->now.tick = m->now.scene.events.tick;
    fail(m, fmi2Discard, "%s ends the simulation at t = %.17g s, within its step", member->name, end);
    return 0;
}

/* Does what the loop returned to its caller for; 0 where it cannot go on. */
static int serve(Model *m, int code) {
    Scene *s = &m->now.scene;
    Loop *l = &s->loop;
    At *at = &s->events.at;
    const Op *op = at->op < 0 ? NULL : l->ops + at->op;
    const double time = seconds(m, s->events.tick);
    switch (code) {
    case PAUSE: return 1;
    case STARTS:
        if (own_points(m, (int)at->what, m->now.changes.round[at->what] + 1)) return 1;
        fail(m, fmi2Error, "the scene's communication points end at t = %.17g s: give it a longer "
             "duration", seconds(m, next_tick(&s->events)));
        return 0;
    case KIND:
        if (new_kind(m)) return 1;
        break;
    case JUDGE:
        at->op++;
        return judge(m, l->fmus + op->a);
    case STOP:
        m->now.mode = ENDED;
        m->now.tick = s->events.tick;
        fail(m, fmi2Discard, "the scene's condition to stop holds at t = %.17g s", time);
        return 0;
    case CALL:
        if (op->code == RECORD) { /* a table holds the newest row */
            *l->tables[op->a].rows = 0;
            return 1;
        }
        if (op->code == STEP && l->fmus[op->a].place->ended) {
            m->now.mode = ENDED;
            m->now.tick = s->events.tick;
            fail(m, fmi2Discard, "%s has ended the simulation", members[fmu_members[op->a]].name);
            return 0;
        }
        if (op->code == SET) {
            fail(m, fmi2Error, "an integer input cannot have its value at t = %.17g s", time);
            return 0;
        }
        break;
    case STEPPED:
        at->op++;
        return took_its_last_step(m, op->a, at->status);
    case FAILED: case UNRESTORED:
        fail(m, fmi2Error, "%s failed at t = %.17g s", members[fmu_members[op->a]].name, time);
        return 0;
    case GROW:
        if (op->code == STEP) {
            add_step_errors(m, op->a);
            return 1;
        }
        if (op->code == SAMPLE || op->code == MOVE) {
            if (meter_fold(l->meters[op->a])) return 1;
            break;
        }
        fail(m, fmi2Error, "the hold of %s has no room for a sample at t = %.17g s", holds[op->a], time);
        return 0;
    }
    fail(m, fmi2Error, "an event at t = %.17g s is none that the scene was resolved for", time);
    return 0;
}

static int advance(Model *m, int64_t until) {
    Scene *s = &m->now.scene;
    while (next_tick(&s->events) < until)
        if (!serve(m, hapticlink_events(&s->loop, &s->events))) return 0;
    m->now.tick = until;
    return 1;
}

/* --- life of an instance -------------------------------------------------------------------- */

void fmi2FreeInstance(fmi2Component c) {
    Model *m = c;
    if (!m) return;
    for (int i = 0; i < N_SLOTS; i++)
        if (m->slots[i]) members[slot_members[i]].free_state(m->members[slot_members[i]], m->slots + i);
    for (int i = 0; i < N_MEMBERS; i++) if (m->members[i]) members[i].free(m->members[i]);
    free(m);
}

/* A block, whose resources are in a folder of those of the program. */
static fmi2Component instantiated(Model *m, const Member *member, fmi2String resources, fmi2Boolean logging) {
    const size_t n = resources ? strlen(resources) : 0, room = n + strlen(member->id) + 2;
    char *location = calloc(room, 1);
    if (!location) return NULL;
    if (n) snprintf(location, room, "%s%s%s", resources, resources[n - 1] == '/' ? "" : "/", member->id);
    fmi2Component c = member->instantiate(member->name, fmi2CoSimulation, member->guid, location,
                                          &m->member_callbacks, fmi2False, logging);
    free(location);
    return c;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    Model *m = allocated(name, type, guid, callbacks);
    if (!m) return NULL;
    const fmi2CallbackFunctions own = {member_logger, calloc, free, NULL, m};
    memcpy(&m->member_callbacks, &own, sizeof own);
    for (int i = 0; i < N_MEMBERS; i++) {
        m->members[i] = instantiated(m, members + i, resources, logging);
        if (m->members[i]) continue;
        fail(m, fmi2Error, "%s cannot be instantiated", members[i].name);
        fmi2FreeInstance(m);
        return NULL;
    }
    if (restart(m) == fmi2OK) return m;
    fmi2FreeInstance(m);
    return NULL;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
    Model *m = c;
    if (out_of_order(m, __func__, INSTANTIATED)) return fmi2Error;
    if (!(start >= 0.0 && start < INFINITY))
        return fail(m, fmi2Error, "a scene starts at 0 s or later, not at %.17g s", start);
    m->now.time = start;
    m->now.scene.loop.begin = start * m->now.scene.loop.denominator;
    m->stop = has_stop ? stop : INFINITY;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Model *m = c;
    if (out_of_order(m, __func__, INSTANTIATED)) return fmi2Error;
    for (int i = 0; i < N_MEMBERS; i++)
        if (members[i].setup(m->members[i], members[i].tolerance > 0.0, members[i].tolerance, m->now.time,
                             fmi2False, 0.0) > fmi2Warning ||
            members[i].enter(m->members[i]) > fmi2Warning)
            return fail(m, fmi2Error, "%s does not enter initialisation mode", members[i].name);
    m->now.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Model *m = c;
    if (out_of_order(m, __func__, INITIALIZATION)) return fmi2Error;
    if (settle(m) != fmi2OK || !are_finite(m)) return fmi2Error;
    m->now.mode = FAILURE;
    for (int i = 0; i < N_MEMBERS; i++)
        if (members[i].exit(m->members[i]) > fmi2Warning)
            return fail(m, fmi2Error, "%s does not leave initialisation mode", members[i].name);
    At at = {0};
    for (int i = 0; i < N_FMUS; i++) /* a block may compute outputs in leaving it */
        if (fmu_get(m->now.scene.loop.fmus + i, 0, &at)) return unsettled(m, i);
    if (!are_finite(m)) return fmi2Error;
    if (begin(m)) return fail(m, fmi2Error, "holds and meters cannot take the samples of t = 0");
    m->now.mode = STEP_MODE;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Model *m = c;
    if (out_of_order(m, __func__, STEP_MODE | ENDED)) return fmi2Error;
    m->now.mode = TERMINATED;
    for (int i = 0; i < N_MEMBERS; i++)
        if (members[i].terminate(m->members[i]) > fmi2Warning)
            return fail(m, fmi2Error, "%s cannot be terminated", members[i].name);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    Model *m = c;
    if (!m) return fmi2Error;
    for (int i = 0; i < N_MEMBERS; i++)
        if (members[i].reset(m->members[i]) > fmi2Warning)
            return fail(m, fmi2Error, "%s cannot be reset: instantiate again", members[i].name);
    return restart(m);
}

/* --- values --------------------------------------------------------------------------------- */

/* A variable of a block as a number. */
static fmi2Status number_of(const Model *m, const Variable *v, double *value) {
    const Member *member = members + v->member;
    fmi2Component c = m->members[v->member];
    int whole = 0;
    if (v->type == REAL) return member->get(c, &v->reference, 1, value);
    const fmi2Status status = (v->type == INTEGER ? member->get_integer : member->get_boolean)(
        c, &v->reference, 1, &whole);
    *value = whole;
    return status;
}

static fmi2Status value_of(Model *m, const Variable *v, double *value) {
    const Loop *l = &m->now.scene.loop;
    switch (v->kind) {
    case OUTSIDE: *value = l->values[v->place]; return fmi2OK;
    case ENERGY: *value = meter_energy(l->meters[v->member]); return fmi2OK;
    case STEP_ERROR: *value = step_error(m, v->member); return fmi2OK;
    case OUTPUT:
        if (m->now.mode == INITIALIZATION && settle(m) != fmi2OK) return fmi2Error;
        if (l->fmus[member_fmus[v->member]].place->end > seconds(m, m->now.tick)) {
            const Table *t = l->tables + member_tables[v->member];
            *value = t->block[1 + v->place - (t->view - l->values)];
            return fmi2OK;
        }
    default: return number_of(m, v, value);
    }
}

fmi2Status fmi2GetReal(fmi2Component c, References vr, size_t n, fmi2Real value[]) {
    Model *m = c;
    if (is_null(m, __func__, n, vr, value)) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        if (is_unknown(m, vr[i], N_VARIABLES) || value_of(m, variables + vr[i], value + i) > fmi2Warning)
            return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, References vr, size_t n, const fmi2Real value[]) {
    Model *m = c;
    if (out_of_order(m, __func__, INSTANTIATED | INITIALIZATION | STEP_MODE)) return fmi2Error;
    if (is_null(m, __func__, n, vr, value)) return fmi2Error;
    for (size_t i = 0; i < n; i++) { /* all are looked at before any is set */
        if (is_unknown(m, vr[i], N_VARIABLES)) return fmi2Error;
        const Variable *v = variables + vr[i];
        if (vr[i] >= N_SETTABLE) return fail(m, fmi2Error, "%s is no input or parameter", v->name);
        if (v->fixed && m->now.mode == STEP_MODE)
            return fail(m, fmi2Error, "parameter %s is fixed; set it before the end of "
                        "initialisation mode", v->name);
        if (!isfinite(value[i])) return fail(m, fmi2Error, "%s cannot be %.17g", v->name, value[i]);
    }
    for (size_t i = 0; i < n; i++) {
        const Variable *v = variables + vr[i];
        if (v->kind == OUTSIDE) m->now.scene.loop_values[v->place] = value[i];
        else if (members[v->member].set(m->members[v->member], &v->reference, 1, value + i) > fmi2Warning)
            return fail(m, fmi2Error, "%s cannot be set to %.17g", v->name, value[i]);
    }
    m->now.settled = 0;
    return fmi2OK;
}

/* --- stepping ------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real start, fmi2Real size, fmi2Boolean no_way_back) {
    Model *m = c;
    if (out_of_order(m, __func__, STEP_MODE)) return fmi2Error;
    const Loop *l = &m->now.scene.loop;
    const double tick = l->numerator / l->denominator, end = start + size;
    if (!(fabs(start - m->now.time) <= NEAR * tick))
        return fail(m, fmi2Error, "a step from t = %.17g s cannot begin: the program stands at %.17g s",
                    start, m->now.time);
    if (!(size > 0.0 && end * l->denominator < 0x1p52 * l->numerator))
        return fail(m, fmi2Error, "a step by %.17g s from t = %.17g s has no end", size, start);
    if (!(end > m->now.time))
        return fail(m, fmi2Error, "a step from t = %.17g s to %.17g s goes back: the program stands at "
                    "%.17g s", start, end, m->now.time);
    if (end > m->stop + NEAR * tick)
        return fail(m, fmi2Error, "a step to t = %.17g s, beyond the stop time %.17g s", end, m->stop);
    const int64_t until = (int64_t)floor((end * l->denominator - l->begin) / l->numerator + NEAR);
    if (until > m->now.tick && !advance(m, until)) {
        if (m->now.mode == ENDED) {
            m->now.time = seconds(m, m->now.tick);
            return fmi2Discard;
        }
        m->now.mode = FAILURE;
        return m->now.scene.events.at.status == fmi2Fatal ? fmi2Fatal : fmi2Error;
    }
    m->now.time = end;
    return fmi2OK;
}

/* --- FMU state ------------------------------------------------------------------------------ */

/* Whether `member`, if there is one, lacks what `call` needs of all. */
static int lacks(const Model *m, const char *call, const char *member) {
    if (member) fail(m, fmi2Error, "%s: %s is an FMU that does not offer this", call, member);
    return member != NULL;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Model *m = c;
    if (is_null(m, __func__, 1, state, state) || lacks(m, __func__, WITHOUT_STATE)) return fmi2Error;
    if (!*state) *state = calloc(1, sizeof(Saved));
    if (!*state) return fail(m, fmi2Error, "no memory for an FMU state");
    Saved *saved = *state;
    memcpy(&saved->now, &m->now, sizeof m->now);
    for (int i = 0; i < N_MEMBERS; i++)
        if (members[i].get_state(m->members[i], saved->members + i) > fmi2Warning) return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Model *m = c;
    const Saved *saved = state;
    if (!is_ours(m, state)) return fmi2Error;
    memcpy(&m->now, &saved->now, sizeof m->now);
    relocate(m);
    for (int i = 0; i < N_MEMBERS; i++)
        if (members[i].set_state(m->members[i], saved->members[i]) > fmi2Warning) return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Model *m = c;
    if (!m) return fmi2Error;
    if (!state || !*state) return fmi2OK;
    Saved *saved = *state;
    for (int i = 0; i < N_MEMBERS; i++) members[i].free_state(m->members[i], saved->members + i);
    free(saved);
    *state = NULL;
    return fmi2OK;
}

/* FNV-1a (Fowler, Noll, Vo), 64 bits: a damaged state would lead anywhere. */
static uint64_t checksum(const fmi2Byte bytes[], size_t size) {
    uint64_t sum = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) sum = (sum ^ (unsigned char)bytes[i]) * 0x100000001b3u;
    return sum;
}

static size_t member_state_size(const Model *m, int i, const Saved *saved) {
    size_t size = 0;
    members[i].state_size(m->members[i], saved->members[i], &size);
    return size;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    Model *m = c;
    if (is_null(m, __func__, 1, state, size) || !is_ours(m, state)) return fmi2Error;
    if (lacks(m, __func__, WITHOUT_BYTES)) return fmi2Error;
    *size = sizeof(State) + sizeof(uint64_t);
    for (int i = 0; i < N_MEMBERS; i++) *size += member_state_size(m, i, state);
    return fmi2OK;
}

/* The bytes hold no addresses: these are written again when the state is set. */
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[],
                                 size_t size) {
    Model *m = c;
    Saved *saved = state;
    size_t needed, at = sizeof(State);
    if (is_null(m, __func__, 1, state, bytes)) return fmi2Error;
    if (fmi2SerializedFMUstateSize(c, state, &needed) != fmi2OK) return fmi2Error;
    if (size < needed) return fail(m, fmi2Error, "too few bytes for the FMU state");
    memcpy(bytes, &saved->now, sizeof(State));
    char *scene = (char *)bytes + offsetof(State, scene);
    for (int i = 0; i < N_POINTERS; i++) memset(scene + pointers[i].at, 0, sizeof(void *));
    for (int i = 0; i < N_HANDLES; i++) memset(scene + handles[i].at, 0, sizeof(void *));
    for (int i = 0; i < N_CALLS; i++) memset(scene + calls[i].at, 0, sizeof(void *));
    for (int i = 0; i < N_SLOTS; i++) memset(scene + slots[i], 0, sizeof(void *));
    for (int i = 0; i < N_MEMBERS; i++) {
        const size_t part = member_state_size(m, i, saved);
        if (members[i].serialize(m->members[i], saved->members[i], bytes + at, part)) return fmi2Error;
        at += part;
    }
    const uint64_t sum = checksum(bytes, at);
    memcpy(bytes + at, &sum, sizeof sum);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state) {
    Model *m = c;
    size_t needed, at = sizeof(State);
    fmi2FMUstate own = NULL;
    if (is_null(m, __func__, 1, bytes, state) || lacks(m, __func__, WITHOUT_BYTES)) return fmi2Error;
    if (!is_ours(m, size >= sizeof(State) ? bytes : NULL)) return fmi2Error;
    if (fmi2GetFMUstate(c, &own) != fmi2OK) return fmi2Error; /* for the sizes of the blocks' states */
    if (fmi2SerializedFMUstateSize(c, own, &needed) != fmi2OK || size != needed) {
        fmi2FreeFMUstate(c, &own);
        return fail(m, fmi2Error, "the FMU state has %zu bytes instead of %zu", size, needed);
    }
    const uint64_t sum = checksum(bytes, size - sizeof sum);
    if (memcmp(bytes + size - sizeof sum, &sum, sizeof sum)) {
        fmi2FreeFMUstate(c, &own);
        return fail(m, fmi2Error, "the FMU state is damaged: its checksum is that of other bytes");
    }
    fmi2FreeFMUstate(c, state);
    Saved *saved = *state = own;
    memcpy(&saved->now, bytes, sizeof(State));
    for (int i = 0; i < N_MEMBERS; i++) {
        const size_t part = member_state_size(m, i, saved);
        if (members[i].deserialize(m->members[i], bytes + at, part, saved->members + i)) return fmi2Error;
        at += part;
    }
    return fmi2OK;
}
