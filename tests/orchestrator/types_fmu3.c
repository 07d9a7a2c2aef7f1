/* An FMI 3.0 co-simulation FMU with an input and an output of every number type: a step copies
   the one to the other. From its fourth step it fails as `mode` says: 1 to 4 are the statuses
   warning to fatal, 5 an abort, 7 an end of the simulation. The file named by FAULT_FMU_LOG gets
   its last calls. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TYPES(X) \
    X(0, Float64, double) X(1, Float32, float) X(2, Int64, int64_t) X(3, Int32, int32_t) \
    X(4, Int16, int16_t) X(5, Int8, int8_t) X(6, UInt64, uint64_t) X(7, UInt32, uint32_t) \
    X(8, UInt16, uint16_t) X(9, UInt8, uint8_t) X(10, Boolean, bool)
enum { KINDS = 11, MODE = 22 };

typedef struct {
#define PAIR(k, name, type) type name[2];
    TYPES(PAIR)
    int32_t mode, steps;
    char text[64];
} Model;

/* An importer may ask for every function of the standard; these are not called. */
#define UNUSED(name) int name(void) { return 3; }
UNUSED(fmi3ActivateModelPartition) UNUSED(fmi3CompletedIntegratorStep)
UNUSED(fmi3DeserializeFMUState) UNUSED(fmi3EnterConfigurationMode)
UNUSED(fmi3EnterContinuousTimeMode) UNUSED(fmi3EnterEventMode) UNUSED(fmi3EnterStepMode)
UNUSED(fmi3EvaluateDiscreteStates) UNUSED(fmi3ExitConfigurationMode) UNUSED(fmi3FreeFMUState)
UNUSED(fmi3GetAdjointDerivative) UNUSED(fmi3GetBinary) UNUSED(fmi3GetClock)
UNUSED(fmi3GetContinuousStateDerivatives) UNUSED(fmi3GetContinuousStates)
UNUSED(fmi3GetDirectionalDerivative) UNUSED(fmi3GetEventIndicators) UNUSED(fmi3GetFMUState)
UNUSED(fmi3GetIntervalDecimal) UNUSED(fmi3GetIntervalFraction)
UNUSED(fmi3GetNominalsOfContinuousStates) UNUSED(fmi3GetNumberOfContinuousStates)
UNUSED(fmi3GetNumberOfEventIndicators) UNUSED(fmi3GetNumberOfVariableDependencies)
UNUSED(fmi3GetOutputDerivatives) UNUSED(fmi3GetShiftDecimal) UNUSED(fmi3GetShiftFraction)
UNUSED(fmi3GetString) UNUSED(fmi3GetVariableDependencies) UNUSED(fmi3GetVersion)
UNUSED(fmi3InstantiateModelExchange) UNUSED(fmi3InstantiateScheduledExecution) UNUSED(fmi3Reset)
UNUSED(fmi3SerializeFMUState) UNUSED(fmi3SerializedFMUStateSize) UNUSED(fmi3SetBinary)
UNUSED(fmi3SetClock) UNUSED(fmi3SetContinuousStates) UNUSED(fmi3SetDebugLogging)
UNUSED(fmi3SetFMUState) UNUSED(fmi3SetIntervalDecimal) UNUSED(fmi3SetIntervalFraction)
UNUSED(fmi3SetShiftDecimal) UNUSED(fmi3SetShiftFraction) UNUSED(fmi3SetTime)
UNUSED(fmi3UpdateDiscreteStates)

static void say(const char *what) {
    const char *path = getenv("FAULT_FMU_LOG");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) fprintf(file, "%s\n", what), fclose(file);
}

/* References: 2k the input, 2k + 1 the output of type k. */
#define ACCESS(k, name, type) \
    int fmi3Get##name(Model *m, const unsigned *vr, size_t n, type *value, size_t size) { \
        for (size_t i = 0; i < n; i++) { \
            if (vr[i] / 2 != k) return 3; \
            value[i] = m->name[vr[i] % 2]; \
        } \
        return n == size ? 0 : 3; \
    } \
    int fmi3Set##name(Model *m, const unsigned *vr, size_t n, const type *value, size_t size) { \
        for (size_t i = 0; i < n; i++) { \
            if (k == 3 && vr[i] == MODE) m->mode = (int32_t)value[i]; \
            else if (vr[i] == 2 * k) m->name[0] = value[i]; \
            else return 3; \
        } \
        return n == size ? 0 : 3; \
    }
TYPES(ACCESS)
int fmi3SetString(Model *m, const unsigned *vr, size_t n, const char *const *value, size_t size) {
    strncpy(m->text, value[0], sizeof m->text - 1);
    return 0;
}

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *required, size_t count, void *environment,
                                  void *log, void *update) {
    return strcmp(token, "{types}") ? NULL : calloc(1, sizeof(Model));
}
void fmi3FreeInstance(Model *m) { say("free"); free(m); }
int fmi3Terminate(Model *m) { say("terminate"); return 0; }
int fmi3EnterInitializationMode(Model *m, bool given, double tolerance, double start, bool stops,
                                double stop) { return 0; }
int fmi3ExitInitializationMode(Model *m) { if (m->text[0]) say(m->text); return 0; }
int fmi3DoStep(Model *m, double time, double size, bool forward, bool *event, bool *terminate,
               bool *early, double *last) {
    int mode = m->steps >= 3 ? m->mode : 0;
    *event = *early = false;
    *terminate = mode == 7;
    *last = time + size;
    if (mode == 5) abort();
    m->steps++;
#define COPY(k, name, type) m->name[1] = m->name[0];
    TYPES(COPY)
    return mode == 7 ? 0 : mode;
}
