/* An FMI 2.0 co-simulation FMU that counts whole seconds from 1 and asks to end the simulation when
   it is at 10, at 9 s: it discards that step, says fmi2Terminated, and how far it came. */
#include <stdlib.h>
#include <stddef.h>
#include <string.h>

typedef struct { double time; int counter, over; } Model;

/* An importer may ask for every function of the standard; these are not called. */
#define UNUSED(name) int name(void) { return 3; }
UNUSED(fmi2SetDebugLogging) UNUSED(fmi2Reset) UNUSED(fmi2GetReal) UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString) UNUSED(fmi2SetReal) UNUSED(fmi2SetInteger) UNUSED(fmi2SetBoolean)
UNUSED(fmi2SetString)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative) UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives) UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus)
UNUSED(fmi2GetIntegerStatus) UNUSED(fmi2GetStringStatus)
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    Model *m = calloc(1, sizeof(Model));
    if (m) m->counter = 1;
    return m;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Model));
    return memcpy(*state, c, sizeof(Model)), 0;
}
int fmi2SetFMUstate(void *c, void *state) { return memcpy(c, state, sizeof(Model)), 0; }
int fmi2FreeFMUstate(void *c, void **state) { return free(*state), *state = NULL, 0; }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double t, double a, int s, double b) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2GetInteger(void *c, const unsigned *vr, size_t n, int *value) {
    for (size_t i = 0; i < n; i++) value[i] = ((Model *)c)->counter;
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int discard) {
    Model *m = c;
    if (m->over) return 3;  /* nothing may follow but reads and the end */
    while (m->counter <= t + h + 1e-9) {
        m->time = m->counter++;
        if (m->counter == 10) return m->over = 1, 2;
    }
    m->time = t + h;
    return 0;
}
int fmi2GetBooleanStatus(void *c, int kind, int *value) { *value = ((Model *)c)->over; return kind != 3; }
int fmi2GetRealStatus(void *c, int kind, double *value) { *value = ((Model *)c)->time; return kind != 2; }
