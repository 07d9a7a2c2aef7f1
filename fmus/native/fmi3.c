/* The FMI 3.0.2 co-simulation interface of an FMU over its functions of FMI 2.0, whose order of calls, checks
 * and messages it has.
 *
 * An array is the scalars of FMI 2.0 from its value reference on, row by row; time follows the last.
 * fmi3_rest.h, generated, has the sizes of the variables, all scalars in order, and those functions of the
 * standard that need event mode, clocks, other types or another kind of FMU: they fail. */
#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

typedef struct {
    fmi2Component program;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3Boolean logging, early; /* early: a step may end before its end */
    const char *call;           /* the function that runs */
    fmi2CallbackFunctions callbacks;
} Instance;

static void say(const Instance *i, fmi3Status status, const char *category, const char *text) {
    if (i->log && (i->logging || status >= fmi3Error)) i->log(i->environment, status, category, text);
}

/* Messages of those functions: formats without arguments (FMI 2.0.5 section 2.1.5), which begin
 * with the name of the one that was called. */
static void pass_on(fmi2ComponentEnvironment own, fmi2String name, fmi2Status status, fmi2String category,
                    fmi2String message, ...) {
    const Instance *i = own;
    char plain[2200], text[2300];
    snprintf(plain, sizeof plain, message);
    if (strncmp(plain, "fmi2", 4)) snprintf(text, sizeof text, "%s", plain);
    else snprintf(text, sizeof text, "%s%s", i->call, plain + strcspn(plain, " "));
    say(i, (fmi3Status)status, category, text);
}

/* The program of an instance, NULL without one, for `call`. */
static fmi2Component program(fmi3Instance instance, const char *call) {
    Instance *i = instance;
    if (!i) return NULL;
    i->call = call;
    return i->program;
}

static fmi3Status refuse(const Instance *i, const char *format, ...) {
    char text[200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (i) say(i, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

static fmi3Status lacks(fmi3Instance instance, const char *call) {
    return refuse(instance, "%s: this FMU is for co-simulation without event mode, and its variables are "
                  "Float64 of fixed sizes", call);
}

#include "fmi3_rest.h"

/* --- life of an instance --------------------------------------------------------------------- */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    if (!program(instance, __func__)) return fmi3Error;
    ((Instance *)instance)->logging = on;
    return fmi3OK;
}

/* The URI of a folder (RFC 8089), as FMI 2.0 has it, of its path, as FMI 3.0 has it; NULL without memory. */
static char *uri_of(fmi3String path) {
    const size_t n = path ? strlen(path) : 0;
    char *uri = calloc(3 * n + sizeof "file:///", 1), *to = uri;
    if (!n || !uri) return uri;
    to += sprintf(to, *path == '/' ? "file://" : "file:///");
    for (const char *c = path; *c; c++)
        if (isalnum((unsigned char)*c) || strchr("/-._~:", *c)) *to++ = *c;
        else to += sprintf(to, *c == '\\' ? "/" : "%%%02X", (unsigned char)*c);
    return uri;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early, const fmi3ValueReference intermediate[],
                                         size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Instance *i = calloc(1, sizeof *i);
    if (!i) return NULL;
    const fmi2CallbackFunctions callbacks = {pass_on, calloc, free, NULL, i};
    memcpy(&i->callbacks, &callbacks, sizeof callbacks);
    i->environment = environment;
    i->log = log;
    i->logging = logging;
    i->early = early;
    i->call = __func__;
    char *uri = uri_of(resources);
    if (event_mode) lacks(i, "event mode");
    else i->program = fmi2Instantiate(name, fmi2CoSimulation, token, uri, &i->callbacks, visible, logging);
    free(uri);
    if (i->program) return i;
    free(i);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) {
    fmi2FreeInstance(program(instance, __func__));
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
    fmi2Component c = program(instance, __func__);
    const fmi2Status status = fmi2SetupExperiment(c, has_tolerance, tolerance, start, has_stop, stop);
    return (fmi3Status)(status == fmi2OK ? fmi2EnterInitializationMode(c) : status);
}

/* A function that is the same as one of FMI 2.0 with these further arguments. */
#define SAME(name, parameters, of_fmi2, ...)                                                        \
    fmi3Status name parameters {                                                                    \
        return (fmi3Status)of_fmi2(program(instance, __func__), ##__VA_ARGS__);                     \
    }
SAME(fmi3ExitInitializationMode, (fmi3Instance instance), fmi2ExitInitializationMode)
SAME(fmi3Terminate, (fmi3Instance instance), fmi2Terminate)
SAME(fmi3Reset, (fmi3Instance instance), fmi2Reset)
SAME(fmi3GetFMUState, (fmi3Instance instance, fmi3FMUState *state), fmi2GetFMUstate, state)
SAME(fmi3SetFMUState, (fmi3Instance instance, fmi3FMUState state), fmi2SetFMUstate, state)
SAME(fmi3FreeFMUState, (fmi3Instance instance, fmi3FMUState *state), fmi2FreeFMUstate, state)
SAME(fmi3SerializedFMUStateSize, (fmi3Instance instance, fmi3FMUState state, size_t *size),
     fmi2SerializedFMUstateSize, state, size)
SAME(fmi3SerializeFMUState, (fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size),
     fmi2SerializeFMUstate, state, (fmi2Byte *)bytes, size)
SAME(fmi3DeserializeFMUState,
     (fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state),
     fmi2DeSerializeFMUstate, (const fmi2Byte *)bytes, size, state)

/* --- values ---------------------------------------------------------------------------------- */

/* Whether n variables are known and have `count` entries together. */
static int fits(const Instance *i, const fmi3ValueReference vr[], size_t n, const double value[], size_t count) {
    size_t entries = 0;
    if (!i) return 0;
    if (n && (!vr || !value)) return !refuse(i, "%s got a null pointer", i->call);
    for (size_t v = 0; v < n; v++) {
        if (vr[v] > N_SCALARS || !sizes[vr[v]]) return !refuse(i, "unknown value reference %u", vr[v]);
        entries += sizes[vr[v]];
    }
    if (entries == count) return 1;
    return !refuse(i, "%s got %zu values for variables of %zu entries", i->call, count, entries);
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[],
                          size_t count) {
    fmi2Component c = program(instance, __func__);
    if (!fits(instance, vr, n, value, count)) return fmi3Error;
    for (size_t v = 0; v < n; value += sizes[vr[v++]])
        if (vr[v] == N_SCALARS ? fmi2GetRealStatus(c, fmi2LastSuccessfulTime, value)
                               : fmi2GetReal(c, scalars + vr[v], sizes[vr[v]], value))
            return fmi3Error;
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 value[], size_t count) {
    fmi2Component c = program(instance, __func__);
    if (!fits(instance, vr, n, value, count)) return fmi3Error;
    fmi2ValueReference *scalars = malloc((count + 1) * sizeof *scalars), *next = scalars;
    if (!scalars) return fmi3Error;
    for (size_t v = 0; v < n; v++)
        for (unsigned k = 0; k < sizes[vr[v]]; k++) *next++ = vr[v] + k;
    const fmi2Status status = fmi2SetReal(c, scalars, count, value);
    free(scalars);
    return (fmi3Status)status;
}

/* --- stepping -------------------------------------------------------------------------------- */

/* An FMU that ends the simulation within a step, which is a discarded one in FMI 2.0, asks to terminate;
 * a step that is discarded otherwise may be taken again, shorter. */
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 start, fmi3Float64 size, fmi3Boolean no_way_back,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    fmi2Component c = program(instance, __func__);
    if (!c) return fmi3Error;
    if (!event || !terminate || !early || !reached) return refuse(instance, "%s got a null pointer", __func__);
    const fmi2Status status = fmi2DoStep(c, start, size, no_way_back);
    fmi2GetRealStatus(c, fmi2LastSuccessfulTime, reached);
    fmi2Boolean ended = 0;
    fmi2GetBooleanStatus(c, fmi2Terminated, &ended);
    *event = false;
    *terminate = status == fmi2Discard && ended;
    *early = *terminate && ((Instance *)instance)->early && *reached < start + size;
    return *terminate ? fmi3OK : (fmi3Status)status;
}
