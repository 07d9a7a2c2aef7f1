/* The law of the FMU, and the functions of the standard that it has no use for. */
#include "../table.h"

#include <stdlib.h>

double integral(const Table *t, double size) { return size * t->gain * t->scale * t->u; }

void fmi2FreeInstance(fmi2Component c) { free(c); }

#define NOTHING(name, ...) fmi2Status name(fmi2Component c, ##__VA_ARGS__) { return fmi2OK; }
NOTHING(fmi2SetupExperiment, fmi2Boolean d, fmi2Real t, fmi2Real a, fmi2Boolean s, fmi2Real b)
NOTHING(fmi2EnterInitializationMode)
NOTHING(fmi2ExitInitializationMode)
NOTHING(fmi2Terminate)

#define FAILS(name, ...) fmi2Status name(fmi2Component c, ##__VA_ARGS__) { return fmi2Error; }
#define REFERENCES const fmi2ValueReference r[], size_t n
FAILS(fmi2Reset)
FAILS(fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String categories[])
FAILS(fmi2GetBoolean, REFERENCES, fmi2Boolean value[])
FAILS(fmi2GetString, REFERENCES, fmi2String value[])
FAILS(fmi2GetFMUstate, fmi2FMUstate *state)
FAILS(fmi2SetFMUstate, fmi2FMUstate state)
FAILS(fmi2FreeFMUstate, fmi2FMUstate *state)
FAILS(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
FAILS(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
FAILS(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
FAILS(fmi2GetDirectionalDerivative, REFERENCES, const fmi2ValueReference k[], size_t m, const fmi2Real s[],
      fmi2Real d[])
FAILS(fmi2SetRealInputDerivatives, REFERENCES, const fmi2Integer order[], const fmi2Real value[])
FAILS(fmi2GetRealOutputDerivatives, REFERENCES, const fmi2Integer order[], fmi2Real value[])
FAILS(fmi2CancelStep)
FAILS(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *value)
FAILS(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *value)
FAILS(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *value)
FAILS(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *value)
FAILS(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *value)
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
