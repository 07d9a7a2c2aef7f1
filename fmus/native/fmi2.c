/* The FMI 2.0.5 co-simulation interface of one component, beside the C that CasADi writes of its
   functions. component.h, generated, holds both the sizes and the functions:

       x0 = initialize(u, p),   y, z = output(x, u, p, t),   x' = substep(x, u, p, t, h),
       x', y, z' = advance(x, u, p, t, h, end, z),   x', y, z' = reduced(x, u, p, t, h, end, z)

   All reals stand in one array [inputs | parameters | outputs]; a place is a value reference.

       continuous   doStep: SUBSTEPS - 1 times x <- substep(x, u, p, t, h/SUBSTEPS), then
                    x, y, z <- advance(...), with the outputs at the end of the step;
                    get: that y, or y = output(x, u, p, t) if values were set since
       sampled      doStep: x, y <- advance(...), with the outputs at t_k, and further substeps;
                    get: that y

   z are values for the next step that the outputs have evaluated already (fmu_functions.py); they
   are no state: where p, x or t are not those that they were evaluated for, they are evaluated
   again.

   With KNOWN_START x0 is a table, whatever u and p.

   reduced, where there is one, leaves out the outputs on request of a plant. It takes the place of
   advance, at once with RARELY = 0, where these have not been read for RARELY steps, or had not been between the last two
   reads; when they are read again, y = output(x, u, p, t), with the same bits.

   Up to the end of initialisation mode both kinds answer a get with y = output(x0, u, p, t) of the
   values set so far. The Python FMU (python_slave.py) does the same operations in the same order.
   Nothing is shared between instances: the tables are constant, the rest stands in a Model.

   A call out of order (section 4.2.4), a null pointer, a time that is not finite, and a step that does
   not begin where the last one ended, goes back or nowhere, or beyond the stop time, are errors that
   change nothing. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#include "component.h"

#if !REDUCED
#define reduced advance /* never called */
#elif !RARELY
#define advance reduced /* never called */
#endif
#if SUBSTEPS == 1
#define substep advance /* never called */
#endif

typedef const fmi2ValueReference *References;

#include "fmi2_model.h"
#include "fmi2_common.h"

/* --- messages ------------------------------------------------------------------------------- */

static const char *standing(const Model *m) {
    const long long mode = m->now.mode;
    return mode == INSTANTIATED ? "is instantiated" : mode == INITIALIZATION ? "is in initialisation mode"
           : mode == STEP ? "is initialised" : "is terminated";
}

static int has_ended(const Model *m) { return 0; }

typedef struct { char text[32]; } Number;

/* The shortest text that reads back as the same double. */
static Number number(double value) {
    Number n;
    if (isnan(value)) strcpy(n.text, "nan");
    else for (int digits = 15; digits < 18; digits++) {
        snprintf(n.text, sizeof n.text, "%.*g", digits, value);
        if (strtod(n.text, NULL) == value) break;
    }
    return n;
}

static int first_not_finite(const double *values, int n) {
    for (int i = 0; i < n; i++) if (!isfinite(values[i])) return i;
    return -1;
}

/* Which state or output is not finite, the likely cause, and what becomes of it. */
static fmi2Status not_finite(const Model *m, fmi2Status status, const char *name, double value,
                             double time, const char *remedy, const char *result) {
    char cause[512] = "inputs and parameters are finite; ";
    strcat(cause, remedy);
    for (int i = 0, shown = 0; i < SETTABLE && shown < 3; i++) {
        if (isfinite(m->now.reals[i])) continue;
        size_t used = shown ? strlen(cause) : 0;
        snprintf(cause + used, sizeof cause - used, "%s%s = %s",
                 shown++ ? ", " : "not finite before: ", names[i], number(m->now.reals[i]).text);
    }
    return fail(m, status, "%s became %s at t = %s; %s; %s", name, number(value).text,
                number(time).text, cause, result);
}

#define SMALLER "take a smaller step or more substeps"
#define DIVISION "look for an input that is 0 and divides"

/* --- the component's functions -------------------------------------------------------------- */

typedef struct { /* room in which a function calls the look-ups of tables */
    casadi_int iw[N_IW + 1];
    double w[N_W + 1];
} Room;

/* z, and what lanes.cpp keeps, are those of another state or of other parameters. */
static void forget(Model *m) {
    m->shared_time = NAN;
    m->kept_by = NULL;
}

static void evaluate_output(Model *m, double time) {
    const double *arguments[N_ARG] = {m->now.x, m->now.reals, m->now.reals + N_U, &time};
    double *results[N_RES] = {m->now.reals + SETTABLE, m->shared};
    Room room;
    output(arguments, results, room.iw, room.w, 0);
    m->shared_time = time;
    m->left_out = 0;
}

/* Bring x0 and y up to date with what was set. */
static void refresh(Model *m) {
    if (m->now.start_due) {
#if KNOWN_START
        memcpy(m->now.x, start_states, sizeof m->now.x);
#else
        const double *arguments[N_ARG] = {m->now.reals, m->now.reals + N_U};
        double *results[N_RES] = {m->now.x};
        Room room;
        initialize(arguments, results, room.iw, room.w, 0);
#endif
        m->now.start_due = 0;
    }
    if (m->now.output_due || m->left_out) {
        evaluate_output(m, m->now.time);
        m->now.output_due = 0;
    }
}

/* Bring outputs up to date before they are read, some of them `on request`. */
static void refresh_outputs(Model *m, int requested) {
    if (REDUCED && !requested) {
        if (m->now.start_due || m->now.output_due) refresh(m);
        return;
    }
    if (m->unread) m->unread_before = m->unread;
    m->unread = 0;
    refresh(m);
}

static void restart(Model *m) {
    memset(&m->now, 0, sizeof m->now);
    memcpy(m->now.guid, GUID, sizeof GUID);
    memcpy(m->now.reals, starts, SETTABLE * sizeof(double));
    m->now.mode = INSTANTIATED;
    m->now.start_due = m->now.output_due = 1;
    forget(m);
    m->left_out = 0;
    m->unread = m->unread_before = 0;
    m->stop = INFINITY;
}

/* --- life of an instance -------------------------------------------------------------------- */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    Model *m = allocated(name, type, guid, callbacks);
    if (m) restart(m);
    return m;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
    Model *m = c;
    if (out_of_order(m, __func__, INSTANTIATED)) return fmi2Error;
    if (!isfinite(start)) return fail(m, fmi2Error, "the start time is %s", number(start).text);
    m->now.time = start;
    m->stop = has_stop ? stop : INFINITY;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Model *m = c;
    if (out_of_order(m, __func__, INSTANTIATED)) return fmi2Error;
    m->now.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Model *m = c;
    if (out_of_order(m, __func__, INITIALIZATION)) return fmi2Error;
    refresh(m);
    int i = first_not_finite(m->now.x, N_X);
    if (i >= 0)
        return not_finite(m, fmi2Error, state_names[i], m->now.x[i], m->now.time, SMALLER,
                          "initialisation goes on");
    m->now.mode = STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Model *m = c;
    if (out_of_order(m, __func__, STEP)) return fmi2Error;
    m->now.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    if (!c) return fmi2Error;
    restart(c);
    return fmi2OK;
}

/* --- values --------------------------------------------------------------------------------- */

/* The largest of value references, 0 of none. */
static fmi2ValueReference largest(References vr, size_t n) {
    fmi2ValueReference last = 0;
    for (size_t i = 0; i < n; i++) last = vr[i] > last ? vr[i] : last;
    return last;
}

fmi2Status fmi2GetReal(fmi2Component c, References vr, size_t n, fmi2Real value[]) {
    Model *m = c;
    if (is_null(m, __func__, n, vr, value)) return fmi2Error;
    const fmi2ValueReference last = largest(vr, n);
    if (n && is_unknown(m, last, REALS)) return fmi2Error;
    if (n && last >= SETTABLE) {
        int requested = 0;
        for (size_t i = 0; REDUCED && i < n; i++)
            requested |= vr[i] >= SETTABLE && on_request[vr[i] - SETTABLE];
        refresh_outputs(m, requested);
    }
    for (size_t i = 0; i < n; i++) value[i] = m->now.reals[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, References vr, size_t n, const fmi2Real value[]) {
    Model *m = c;
    if (out_of_order(m, __func__, INSTANTIATED | INITIALIZATION | STEP)) return fmi2Error;
    if (is_null(m, __func__, n, vr, value)) return fmi2Error;
    const int initialized = m->now.mode == STEP;
    const fmi2ValueReference last = largest(vr, n);
    if (n && last >= N_U) { /* not inputs alone: all are looked at before any is set */
        if (is_unknown(m, last, REALS)) return fmi2Error;
        if (last >= SETTABLE)
            return fail(m, fmi2Error, "%s is an output; it cannot be set", names[last]);
        for (size_t i = 0; initialized && i < n; i++)
            if (is_fixed[vr[i]])
                return fail(m, fmi2Error, "parameter %s is fixed; set it before the end of "
                            "initialisation mode", names[vr[i]]);
        forget(m);
    }
    for (size_t i = 0; i < n; i++) m->now.reals[vr[i]] = value[i];
    if (!initialized) m->now.start_due = 1;
    if (!initialized || !SAMPLED) m->now.output_due = 1;
    return fmi2OK;
}

/* --- stepping ------------------------------------------------------------------------------- */

/* Whether a step does not begin where the FMU stands and end later, at the stop time at most. Steps
 * whose times are added up are off by less than NEAR of one. */
static int refuses_step(const Model *m, double start, double size) {
    const double end = start + size, near = NEAR * size;
    if (!(size > 0.0) || !isfinite(end))
        fail(m, fmi2Error, "a step from t = %s by %s s has no end after it", number(start).text,
             number(size).text);
    else if (!(fabs(start - m->now.time) <= near))
        fail(m, fmi2Error, "a step from t = %s s: the FMU stands at %s s", number(start).text,
             number(m->now.time).text);
    else if (end > m->stop + near)
        fail(m, fmi2Error, "a step to t = %s s, beyond the stop time %s s", number(end).text,
             number(m->stop).text);
    else
        return 0;
    return 1;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real start, fmi2Real size, fmi2Boolean no_way_back) {
    Model *m = c;
    if (out_of_order(m, __func__, STEP)) return fmi2Error;
    double time, h = size / SUBSTEPS, end = start + size;
    if (refuses_step(m, start, size)) return fmi2Error;
    double *const y = SAMPLED ? m->sample : m->now.reals + SETTABLE;
    const double *arguments[N_ARG] = {m->trial, m->now.reals, m->now.reals + N_U, &time, &h, &end,
                                      m->shared};
    double *results[N_RES] = {m->after, y, m->next};
    Room room;
    if (m->now.start_due) refresh(m);
    if (N_Z && m->shared_time != start) evaluate_output(m, start);
    /* Until the step is accepted, a plant's outputs are to be evaluated again. */
    m->now.output_due = !SAMPLED;
    forget(m);
    memcpy(m->trial, m->now.x, sizeof m->trial);
    const int less = REDUCED && (m->unread >= RARELY || m->unread_before >= RARELY);
    for (int k = 0; k < SUBSTEPS; k++) {
        time = start + k * size / SUBSTEPS;
        (k != WITH_OUTPUTS ? substep : less ? reduced : advance)(arguments, results, room.iw, room.w, 0);
        memcpy(m->trial, m->after, sizeof m->trial);
    }
    int i = first_not_finite(m->trial, N_X);
    if (i >= 0) {
        m->now.time = start;
        return not_finite(m, fmi2Discard, state_names[i], m->trial[i], start + size, SMALLER,
                          "the state stays as before the step");
    }
    if (SAMPLED) {
        if ((i = first_not_finite(m->sample, N_Y)) >= 0) {
            m->now.time = start;
            return not_finite(m, fmi2Discard, names[SETTABLE + i], m->sample[i], start, DIVISION,
                              "state and outputs stay as before the step");
        }
        memcpy(m->now.reals + SETTABLE, m->sample, sizeof m->sample);
    }
    memcpy(m->now.x, m->trial, sizeof m->trial);
    memcpy(m->shared, m->next, sizeof m->shared);
    m->now.time = m->shared_time = end;
    m->now.output_due = 0;
    m->left_out = less;
    m->unread++;
    return fmi2OK;
}

/* --- FMU state: bytes, so that saving and serialising are the same, bit for bit -------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Model *m = c;
    if (is_null(m, __func__, 1, state, state)) return fmi2Error;
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return fail(m, fmi2Error, "no memory for an FMU state");
    if (m->left_out) refresh(m);
    memcpy(*state, &m->now, sizeof(State));
    /* A plant's outputs follow from the rest, also where an importer has changed the bytes. */
    if (!SAMPLED) ((State *)*state)->output_due = 1;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Model *m = c;
    if (!is_ours(m, state)) return fmi2Error;
    memcpy(&m->now, state, sizeof(State));
    forget(m);
    m->left_out = 0;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!c) return fmi2Error;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    Model *m = c;
    if (is_null(m, __func__, 1, state, size)) return fmi2Error;
    *size = sizeof(State);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[],
                                 size_t size) {
    Model *m = c;
    if (is_null(m, __func__, 1, state, bytes)) return fmi2Error;
    if (size < sizeof(State)) return fail(m, fmi2Error, "too few bytes for the FMU state");
    memcpy(bytes, state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state) {
    Model *m = c;
    if (is_null(m, __func__, 1, bytes, state)) return fmi2Error;
    if (!is_ours(m, size == sizeof(State) ? bytes : NULL)) return fmi2Error;
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return fail(m, fmi2Error, "no memory for an FMU state");
    memcpy(*state, bytes, sizeof(State));
    return fmi2OK;
}
