/* An FMI 2.0 co-simulation FMU of two C files with the headers of the standard:  y' = gain u, with a
 * gain that is read from its resources, times `scale`, as long as it is `on`; `steps` counts those of
 * all instances of the library, `size` is that of the parameter `text`. After `most` steps it fails by
 * `failure`, a status. */
#include "table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int steps; /* another FMU may have a variable of this name */

static double from_file(fmi2String resources) {
    char path[1000];
    double gain = -1.0;
    snprintf(path, sizeof path, "%s/gain.txt", resources + strlen("file://"));
    FILE *file = fopen(path, "r");
    if (!file) return gain;
    if (fscanf(file, "%lf", &gain) != 1) gain = -2.0;
    fclose(file);
    return gain;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    if (strcmp(guid, "table")) return NULL;
    Table *t = calloc(1, sizeof *t);
    t->callbacks = callbacks;
    t->gain = from_file(resources);
    t->scale = 1.0;
    t->on = 1;
    t->most = 1000000;
    t->failure = fmi2Error;
    steps = 0;
    return t;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_way_back) {
    Table *t = c;
    steps++;
    if (steps > t->most) {
        t->callbacks->logger(t->callbacks->componentEnvironment, "table", t->failure, "logStatusError",
                             "%d steps of %s, 100%% of them", t->most, "mine");
        return t->failure;
    }
    if (t->on) t->y += integral(t, size);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real value[]) {
    const Table *t = c;
    for (size_t i = 0; i < n; i++) value[i] = r[i] == 0 ? t->u : r[i] == 1 ? t->y : r[i] == 7 ? t->gain : t->scale;
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real value[]) {
    Table *t = c;
    for (size_t i = 0; i < n; i++) *(r[i] ? &t->scale : &t->u) = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer value[]) {
    const Table *t = c;
    for (size_t i = 0; i < n; i++) value[i] = r[i] == 3 ? steps : r[i] == 4 ? t->most : t->size;
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer value[]) {
    Table *t = c;
    for (size_t i = 0; i < n; i++) *(r[i] == 4 ? &t->most : &t->failure) = value[i];
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean value[]) {
    ((Table *)c)->on = value[n - 1];
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String value[]) {
    ((Table *)c)->size = (int)strlen(value[0]);
    return fmi2OK;
}
