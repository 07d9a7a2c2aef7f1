/* The life of two instances of a program of FMI 3.0, for checks of memory and undefined behaviour. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

static int said;

static void logger(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String message) {
    said += strlen(category) && strlen(message);
}

/* Sum of all variables, of up to 16 entries each, after `steps` steps. */
static double stepped(fmi3Instance c, double from, int steps, double size, unsigned n) {
    double sum = 0.0, reached, *values;
    bool event, terminate, early;
    for (int i = 0; i < steps; i++)
        if (fmi3DoStep(c, from + i * size, size, false, &event, &terminate, &early, &reached)) exit(2);
    for (unsigned k = 0; k < n; k++)
        for (size_t count = 1; count <= 16; count++) {
            values = malloc(count * sizeof *values);
            const int fits = !fmi3GetFloat64(c, &k, 1, values, count);
            if (fits && k < n - 1) for (size_t i = 0; i < count; i++) sum += values[i];
            free(values);
            if (fits) break;
        }
    return sum;
}

static fmi3Instance initialised(const char *token) {
    fmi3Instance c = fmi3InstantiateCoSimulation("one", token, NULL, false, false, false, false, NULL, 0, NULL,
                                                 logger, NULL);
    if (!c || fmi3EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0)) exit(4);
    if (fmi3ExitInitializationMode(c)) exit(5);
    return c;
}

/* token, number of scalars with time, step size */
int main(int argc, char **argv) {
    const unsigned n = (unsigned)atoi(argv[2]), unknown = 999999, none[] = {0, 1};
    const double h = atof(argv[3]), values[64] = {0.0};
    fmi3Instance one = initialised(argv[1]), two = initialised(argv[1]);
    fmi3FMUState state = NULL, read = NULL;
    size_t size;
    stepped(one, 0.0, 150, h, n);
    if (fmi3GetFMUState(one, &state) || fmi3SerializedFMUStateSize(one, state, &size)) return 6;
    unsigned char *bytes = malloc(size);
    if (fmi3SerializeFMUState(one, state, bytes, size)) return 7;
    if (fmi3DeserializeFMUState(two, bytes, size, &read) || fmi3SetFMUState(two, read)) return 8;
    const double first = stepped(one, 150 * h, 150, h, n), second = stepped(two, 150 * h, 150, h, n);
    if (first != second) return 9;
    said = 0;
    if (fmi3SetFloat64(one, &unknown, 1, values, 1) != fmi3Error) return 10;
    if (fmi3SetFloat64(one, none, 2, values, 64) != fmi3Error || fmi3EnterStepMode(one) != fmi3Error) return 11;
    if (fmi3GetFloat64(one, NULL, 1, NULL, 1) != fmi3Error || said != 4) return 12;
    if (fmi3InstantiateModelExchange("one", argv[1], NULL, false, false, NULL, logger) || said != 5) return 13;
    if (fmi3InstantiateCoSimulation("one", "other", NULL, 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL)) return 14;
    if (fmi3Reset(NULL) != fmi3Error || fmi3GetFMUState(NULL, &state) != fmi3Error) return 15;
    if (fmi3SetDebugLogging(one, false, 0, NULL)) return 17;
    fmi3FreeFMUState(one, &state);
    fmi3FreeFMUState(two, &read);
    if (fmi3Reset(one) || fmi3Terminate(two)) return 16;
    fmi3FreeInstance(one);
    fmi3FreeInstance(two);
    fmi3FreeInstance(NULL);
    for (int i = 0; i < 20; i++) fmi3FreeInstance(initialised(argv[1]));
    free(bytes);
    printf("%zu bytes of state, sum %.17g\n", size, first);
    return 0;
}
