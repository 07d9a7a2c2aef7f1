/* A model-exchange FMU of FMI 2.0 or 3.0 (FMI), which returns an error where the standard allows a
   call in another state only.  x' = -k (x - u); where x falls to `level` it is put to `top` in event
   mode, and `falls` counts. Time events at multiples of `every`, added up, count in `alarms` where
   the FMU's time has reached them. `w` is a discrete input, `seen` it as of the last event.
   `completed` counts completed steps, `entered` event modes, `beyond` is how far past a time event it
   was evaluated (s). With `mode` 1 the derivative is NaN from `from` (s) on, with 2 discarded, with 3
   an error; with 4 it asks to end by a completed step there, with 5 for event mode, once. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { X, DER, U, K, LEVEL, TOP, EVERY, W, MODE, FROM, FALLS, ALARMS, SEEN, COMPLETED, ENTERED, BEYOND, REALS };
enum { INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS };
typedef struct { int state; double r[REALS], time, alarm; } Model;
static const Model STARTED = {0, {[X] = 1, [K] = 2, [LEVEL] = 0.5, [TOP] = 1, [FROM] = 0.1}, 0, 0};
static Model *instance(void) {
    Model *m = malloc(sizeof(Model));
    *m = STARTED;
    return m;
}

#if FMI == 2
#define BOOL int
#define SIZE
#define CALL(name) fmi2##name
#define UNUSED(name) int name(void) { return 3; }
UNUSED(fmi2SetDebugLogging) UNUSED(fmi2Reset) UNUSED(fmi2GetInteger) UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString) UNUSED(fmi2SetInteger) UNUSED(fmi2SetBoolean) UNUSED(fmi2SetString)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative)
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    return type == 0 ? instance() : NULL;
}
int fmi2SetupExperiment(Model *m, int d, double t, double a, int s, double b) { return 0; }
int fmi2EnterInitializationMode(Model *m) { m->state = INITIALIZATION; return 0; }
#else
#define BOOL bool
#define SIZE , size_t size
#define CALL(name) fmi3##name
void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources,
                                   bool visible, bool logging, void *environment, void *log) {
    return instance();
}
int fmi3EnterInitializationMode(Model *m, bool d, double t, double a, bool s, double b) {
    m->state = INITIALIZATION;
    return 0;
}
int fmi3GetNumberOfContinuousStates(Model *m, size_t *n) { *n = 1; return 0; }
int fmi3GetNumberOfEventIndicators(Model *m, size_t *n) { *n = 1; return 0; }
#define fmi3GetDerivatives fmi3GetContinuousStateDerivatives
#define fmi3SetReal fmi3SetFloat64
#define fmi3GetReal fmi3GetFloat64
#define fmi3GetFMUstate fmi3GetFMUState
#define fmi3SetFMUstate fmi3SetFMUState
#define fmi3FreeFMUstate fmi3FreeFMUState
#endif

void CALL(FreeInstance)(Model *m) { free(m); }
int CALL(Terminate)(Model *m) { return m->state >= EVENT ? 0 : 3; }
int CALL(ExitInitializationMode)(Model *m) {
    if (m->state != INITIALIZATION) return 3;
    m->state = EVENT;
    m->alarm = m->r[EVERY];
    return 0;
}
int CALL(EnterEventMode)(Model *m) {
    if (m->state != CONTINUOUS) return 3;
    m->state = EVENT;
    m->r[ENTERED]++;
    return 0;
}
int CALL(EnterContinuousTimeMode)(Model *m) {
    if (m->state != EVENT) return 3;
    m->state = CONTINUOUS;
    return 0;
}
static int update(Model *m) {
    if (m->state != EVENT) return 3;
    m->r[SEEN] = m->r[W];
    if (m->r[X] <= m->r[LEVEL]) {
        m->r[X] = m->r[TOP];
        m->r[FALLS]++;
    }
    if (m->time >= m->alarm) {
        m->r[ALARMS]++;
        m->alarm += m->r[EVERY];
    }
    return 0;
}
#if FMI == 2
typedef struct { int more, ends, nominals, values, defined; double next; } Info;
int fmi2NewDiscreteStates(Model *m, Info *info) {
    *info = (Info){0, 0, 0, 1, m->r[EVERY] > 0, 0};
    int status = update(m);
    info->next = m->alarm;
    return status;
}
#else
int fmi3UpdateDiscreteStates(Model *m, bool *more, bool *ends, bool *nominals, bool *values,
                             bool *defined, double *next) {
    *more = *ends = *nominals = false;
    *values = true;
    *defined = m->r[EVERY] > 0;
    int status = update(m);
    *next = m->alarm;
    return status;
}
#endif
int CALL(SetTime)(Model *m, double time) {
    if (m->state < EVENT) return 3;
    if (m->r[EVERY] > 0 && time > m->alarm) m->r[BEYOND] = fmax(m->r[BEYOND], time - m->alarm);
    m->time = time;
    return 0;
}
int CALL(GetContinuousStates)(Model *m, double *x, size_t n) {
    *x = m->r[X];
    return n == 1 ? 0 : 3;
}
int CALL(SetContinuousStates)(Model *m, const double *x, size_t n) {
    m->r[X] = *x;
    return n == 1 && m->state == CONTINUOUS ? 0 : 3;
}
int CALL(GetNominalsOfContinuousStates)(Model *m, double *x, size_t n) {
    *x = 1;
    return n == 1 ? 0 : 3;
}
int CALL(GetDerivatives)(Model *m, double *dx, size_t n) {
    int wrong = m->time >= m->r[FROM] && m->r[MODE] < 4 ? (int)m->r[MODE] : 0;
    *dx = wrong == 1 ? NAN : -m->r[K] * (m->r[X] - m->r[U]);
    return n != 1 || m->state != CONTINUOUS ? 3 : wrong > 1 ? wrong : 0;
}
int CALL(GetEventIndicators)(Model *m, double *z, size_t n) {
    *z = m->r[X] - m->r[LEVEL];
    return n == 1 && m->state == CONTINUOUS ? 0 : 3;
}
int CALL(CompletedIntegratorStep)(Model *m, BOOL final, BOOL *enter, BOOL *ends) {
    m->r[COMPLETED]++;
    *enter = m->r[MODE] == 5 && m->time >= m->r[FROM] && !m->r[ENTERED];
    *ends = m->r[MODE] == 4 && m->time >= m->r[FROM];
    return m->state == CONTINUOUS ? 0 : 3;
}
int CALL(GetReal)(Model *m, const unsigned *vr, size_t n, double *value SIZE) {
    for (size_t i = 0; i < n; i++) value[i] = m->r[vr[i]];
    return 0;
}
int CALL(SetReal)(Model *m, const unsigned *vr, size_t n, const double *value SIZE) {
    for (size_t i = 0; i < n; i++) {
        if (m->state == CONTINUOUS && vr[i] != U) return 3;
        m->r[vr[i]] = value[i];
    }
    return 0;
}
int CALL(GetFMUstate)(Model *m, Model **state) {
    if (!*state) *state = malloc(sizeof(Model));
    **state = *m;
    return 0;
}
int CALL(SetFMUstate)(Model *m, Model *state) { *m = *state; return 0; }
int CALL(FreeFMUstate)(Model *m, Model **state) { free(*state); *state = NULL; return 0; }
