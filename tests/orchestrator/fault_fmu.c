/* An FMI 2.0 co-simulation FMU that fails as its input `mode` says: 0 counts, 1 to 4 are the
   statuses warning to fatal, 5 an abort, 6 never returns, 7 a discard that asks to end the simulation,
   8 an error when it is read after the third step. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct { double mode, y; } Model;

/* The file named by FAULT_FMU_LOG gets the last calls. */
static void say(const char *what) {
    const char *path = getenv("FAULT_FMU_LOG");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) fprintf(file, "%s\n", what), fclose(file);
}

/* An importer may ask for every function of the standard; these are not called. */
#define UNUSED(name) int name(void) { return 3; }
UNUSED(fmi2SetDebugLogging) UNUSED(fmi2Reset) UNUSED(fmi2GetInteger) UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString) UNUSED(fmi2SetInteger) UNUSED(fmi2SetBoolean) UNUSED(fmi2SetString)
UNUSED(fmi2GetFMUstate) UNUSED(fmi2SetFMUstate) UNUSED(fmi2FreeFMUstate)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative) UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives) UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus)
UNUSED(fmi2GetRealStatus) UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetStringStatus)
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    return strcmp(guid, "{faults}") ? NULL : calloc(1, sizeof(Model));
}
void fmi2FreeInstance(void *c) { say("free"); free(c); }
int fmi2SetupExperiment(void *c, int d, double t, double a, int s, double b) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { say("terminate"); return 0; }
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *value) {
    if (((Model *)c)->mode == 8 && ((Model *)c)->y >= 3) return 3;
    for (size_t i = 0; i < n; i++) value[i] = vr[i] ? ((Model *)c)->y : ((Model *)c)->mode;
    return 0;
}
int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *value) {
    for (size_t i = 0; i < n; i++) if (!vr[i]) ((Model *)c)->mode = value[i];
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int discard) {
    Model *m = c;
    int mode = m->y >= 3 ? (int)m->mode : 0;  /* the first three steps are good */
    if (mode == 5) abort();
    for (; mode == 6;) ;
    m->y += 1;
    return mode == 7 ? 2 : mode == 8 ? 0 : mode;
}
#ifdef PYTHON /* as in pythonfmu's library: to be called once before the destructor */
static int released;
void finalizePythonInterpreter(void) { released++; }
__attribute__((destructor)) static void unload(void) {
    say(released == 1 ? "unloaded after its interpreter" : "unloaded with its interpreter");
}
#endif
int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    *value = kind == 3 && ((Model *)c)->mode == 7;
    return 0;
}
