/* The whole life of two instances of a program, for checks of memory and undefined behaviour. */

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)e, (void)name, (void)status, (void)category, (void)message;
}

static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};

static double stepped(fmi2Component c, double from, int steps, double size, unsigned n) {
    double *values = malloc(n * sizeof *values), sum = 0.0;
    for (int i = 0; i < steps; i++)
        if (fmi2DoStep(c, from + i * size, size, 0)) exit(2);
    for (unsigned k = 0; k < n; k++) {
        if (fmi2GetReal(c, &k, 1, values + k)) exit(3);
        sum += values[k];
    }
    free(values);
    return sum;
}

static fmi2Component initialised(const char *guid) {
    fmi2Component c = fmi2Instantiate("one", fmi2CoSimulation, guid, "", &callbacks, 0, 0);
    if (!c || fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0)) exit(4);
    if (fmi2EnterInitializationMode(c) || fmi2ExitInitializationMode(c)) exit(5);
    return c;
}

/* guid, number of variables, step size */
int main(int argc, char **argv) {
    const unsigned n = (unsigned)atoi(argv[2]);
    const double h = atof(argv[3]);
    fmi2Component one = initialised(argv[1]), two = initialised(argv[1]);
    fmi2FMUstate state = NULL, read = NULL;
    size_t size;
    stepped(one, 0.0, 150, h, n);
    if (fmi2GetFMUstate(one, &state) || fmi2SerializedFMUstateSize(one, state, &size)) return 6;
    char *bytes = malloc(size);
    if (fmi2SerializeFMUstate(one, state, bytes, size)) return 7;
    if (fmi2DeSerializeFMUstate(two, bytes, size, &read) || fmi2SetFMUstate(two, read)) return 8;
    const double first = stepped(one, 150 * h, 150, h, n), second = stepped(two, 150 * h, 150, h, n);
    if (first != second) return 9;
    if (fmi2SetFMUstate(one, state) || stepped(one, 150 * h, 150, h, n) != first) return 10;
    double nothing;
    const unsigned unknown = 999999;
    if (fmi2GetReal(one, &unknown, 1, &nothing) != fmi2Error) return 11;
    if (fmi2DeSerializeFMUstate(two, bytes, size - 1, &read) != fmi2Error) return 12;
    fmi2FreeFMUstate(one, &state);
    fmi2FreeFMUstate(two, &read);
    if (fmi2Reset(one) || fmi2Terminate(two)) return 13;
    fmi2FreeInstance(one);
    fmi2FreeInstance(two);
    for (int i = 0; i < 20; i++) fmi2FreeInstance(initialised(argv[1]));
    free(bytes);
    printf("%zu bytes of state, sum %.17g\n", size, first);
    return 0;
}
