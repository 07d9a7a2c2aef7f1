/* What the FMI functions of a component (fmi2.c) and of a scene as one program (program.c) share. Included
 * behind Model, whose `now` has mode and time, and `standing`: how an instance stands, in words. */

static const char *standing(const Model *m);
static int has_ended(const Model *m);

/* --- messages ------------------------------------------------------------------------------- */

static void say(const Model *m, fmi2Status status, const char *text) {
    static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                             "logStatusError", "logStatusFatal"};
    m->callbacks.logger(m->callbacks.componentEnvironment, m->name, status, categories[status], text);
}

static fmi2Status fail(const Model *m, fmi2Status status, const char *format, ...) {
    if (!m) return fmi2Error; /* no instance, so no logger */
    char plain[1024], text[2 * sizeof plain], *to_text = text;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(plain, sizeof plain, format, arguments);
    va_end(arguments);
    for (const char *c = plain; *c; *to_text++ = *c++)
        if (*c == '%') *to_text++ = '%'; /* the logger takes a message for a format (2.1.5) */
    *to_text = 0;
    say(m, status, text);
    return status;
}

/* Whether `call` may not be made: without an instance, or in another mode than `allowed`. */
static int out_of_order(const Model *m, const char *call, int allowed) {
    if (m && m->now.mode & allowed) return 0;
    fail(m, fmi2Error, "%s may not be called: the FMU %s", call, m ? standing(m) : "");
    return 1;
}

/* Whether `call` got no instance, or a null pointer for one of two arrays of n entries. */
static int is_null(const Model *m, const char *call, size_t n, const void *a, const void *b) {
    if (m && (!n || (a && b))) return 0;
    fail(m, fmi2Error, "%s got a null pointer for %zu entries", call, n);
    return 1;
}

/* Whether the bytes of a state are those of this FMU. */
static int is_ours(const Model *m, const void *bytes) {
    if (m && bytes && !memcmp(bytes, GUID, sizeof GUID)) return 1;
    fail(m, fmi2Error, "this FMU state was not saved by this FMU");
    return 0;
}

/* Whether a value reference is none of the `known` first. */
static int is_unknown(const Model *m, fmi2ValueReference reference, unsigned known) {
    if (reference < known) return 0;
    fail(m, fmi2Error, "unknown value reference %u; %u are known", reference, known);
    return 1;
}

/* A new instance with its name and callbacks; NULL where it cannot be one of this FMU. */
static Model *allocated(fmi2String name, fmi2Type type, fmi2String guid,
                        const fmi2CallbackFunctions *callbacks) {
    if (!callbacks || !callbacks->logger || !name || !guid) return NULL;
    Model *m = calloc(1, sizeof(Model) + strlen(name) + 1);
    if (!m) return NULL;
    strcpy(m->name, name);
    m->callbacks = *callbacks;
    if (type == fmi2CoSimulation && !strcmp(guid, GUID)) return m;
    if (type != fmi2CoSimulation) fail(m, fmi2Error, "this FMU is for co-simulation only");
    else fail(m, fmi2Error, "the guid %s is not that of this binary, %s", guid, GUID);
    free(m);
    return NULL;
}

/* --- what there is none of ------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                               const fmi2String categories[]) {
    return c ? fmi2OK : fmi2Error; /* failures are always logged; there is nothing else to say */
}

#define HAS_NO(verb, kind, type)                                                                \
    fmi2Status fmi2##verb##kind(fmi2Component c, References vr, size_t n, type value[]) {       \
        return c && !n ? fmi2OK : fail(c, fmi2Error, "no variable is of type " #kind);          \
    }
HAS_NO(Get, Integer, fmi2Integer)
HAS_NO(Get, Boolean, fmi2Boolean)
HAS_NO(Get, String, fmi2String)
HAS_NO(Set, Integer, const fmi2Integer)
HAS_NO(Set, Boolean, const fmi2Boolean)
HAS_NO(Set, String, const fmi2String)

fmi2Status fmi2CancelStep(fmi2Component c) {
    return fail(c, fmi2Error, "no step is ever pending");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (!c || !value) return fmi2Error;
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Model *)c)->now.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (!c || !value) return fmi2Error;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = has_ended(c);
    return fmi2OK;
}

#define NOT_KEPT(name, type)                                                                    \
    fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *value) { return fmi2Discard; }
NOT_KEPT(fmi2GetStatus, fmi2Status)
NOT_KEPT(fmi2GetIntegerStatus, fmi2Integer)
NOT_KEPT(fmi2GetStringStatus, fmi2String)

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, References vr, size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    return fail(c, fmi2Error, "inputs are constant over a step");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, References vr, size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    return fail(c, fmi2Error, "there are no derivatives of outputs");
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, References unknown, size_t n,
                                        References known, size_t k, const fmi2Real seed[],
                                        fmi2Real derivative[]) {
    return fail(c, fmi2Error, "there are no directional derivatives");
}
