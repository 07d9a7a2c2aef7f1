/* An FMI 3.0 co-simulation FMU with an input and an output of every number type: a step copies
   the one to the other. The file named by TYPES_FMU_LOG gets its text and blob. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TYPES(X) \
    X(0, Float64, double) X(1, Float32, float) X(2, Int64, int64_t) X(3, Int32, int32_t) \
    X(4, Int16, int16_t) X(5, Int8, int8_t) X(6, UInt64, uint64_t) X(7, UInt32, uint32_t) \
    X(8, UInt16, uint16_t) X(9, UInt8, uint8_t) X(10, Boolean, bool)
enum { KINDS = 11, SIZE = 24, ARRAY = 25, SUM = 26, BLOB = 27, ECHO = 28, LARGEST = 9 };

typedef struct {
#define PAIR(k, name, type) type name[2];
    TYPES(PAIR)
    char text[64];
    bool configuring;
    uint64_t size;
    double array[LARGEST];
    unsigned char blob[24];
    size_t blob_size;
} Model;

static void say(const char *what) {
    const char *path = getenv("TYPES_FMU_LOG");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) fprintf(file, "%s\n", what), fclose(file);
}

/* References: 2k the input, 2k + 1 the output of type k. A matrix of `size` rows and columns, whose
   size is set in configuration mode alone, has its entries added up by their weights 1, 2, ... */
static bool of_array(Model *m, unsigned vr, double *value, bool set) {
    size_t count = m->size * m->size;
    if (vr == SUM && !set) {
        *value = 0;
        for (size_t i = 0; i < count; i++) *value += (double)(i + 1) * m->array[i];
        return true;
    }
    if (vr != ARRAY || !set) return false;
    memcpy(m->array, value, count * sizeof *value);
    return true;
}
#define ACCESS(k, name, type) \
    int fmi3Get##name(Model *m, const unsigned *vr, size_t n, type *value, size_t size) { \
        for (size_t i = 0; i < n; i++) { \
            if (k == 0 && vr[i] >= SIZE) { \
                if (!of_array(m, vr[i], (double *)(value + i), false)) return 3; \
                continue; \
            } \
            if (vr[i] / 2 != k) return 3; \
            value[i] = m->name[vr[i] % 2]; \
        } \
        return n == size ? 0 : 3; \
    } \
    int fmi3Set##name(Model *m, const unsigned *vr, size_t n, const type *value, size_t size) { \
        if (k == 0 && n == 1 && vr[0] == ARRAY) \
            return size == m->size * m->size && of_array(m, ARRAY, (double *)value, true) ? 0 : 3; \
        for (size_t i = 0; i < n; i++) { \
            if (k == 6 && vr[i] == SIZE) { \
                if (!m->configuring || value[i] > 3) return 3; \
                m->size = (uint64_t)value[i]; \
            } else if (vr[i] == 2 * k) m->name[0] = value[i]; \
            else return 3; \
        } \
        return n == size ? 0 : 3; \
    }
TYPES(ACCESS)
int fmi3SetString(Model *m, const unsigned *vr, size_t n, const char *const *value, size_t size) {
    strncpy(m->text, value[0], sizeof m->text - 1);
    return 0;
}

int fmi3SetBinary(Model *m, const unsigned *vr, size_t n, const size_t *sizes,
                  const unsigned char *const *value, size_t count) {
    char text[64] = "blob ";
    if (vr[0] != BLOB || sizes[0] > sizeof m->blob) return 3;
    memcpy(m->blob, value[0], m->blob_size = sizes[0]);
    for (size_t i = 0; i < sizes[0] && i < 24; i++) sprintf(text + 5 + 2 * i, "%02x", value[0][i]);
    say(text);
    return 0;
}
int fmi3GetBinary(Model *m, const unsigned *vr, size_t n, size_t *sizes, const unsigned char **value,
                  size_t count) {
    *value = m->blob;
    *sizes = m->blob_size;
    return vr[0] == ECHO ? 0 : 3;
}
int fmi3EnterConfigurationMode(Model *m) { m->configuring = true; return 0; }
int fmi3ExitConfigurationMode(Model *m) { m->configuring = false; return 0; }

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *required, size_t count, void *environment,
                                  void *log, void *update) {
    Model *m = strcmp(token, "types") ? NULL : calloc(1, sizeof(Model));
    if (m) m->size = 2;
    return m;
}
void fmi3FreeInstance(Model *m) { free(m); }
int fmi3Terminate(Model *m) { return 0; }
int fmi3EnterInitializationMode(Model *m, bool given, double tolerance, double start, bool stops,
                                double stop) { return 0; }
int fmi3ExitInitializationMode(Model *m) { if (m->text[0]) say(m->text); return 0; }
int fmi3DoStep(Model *m, double time, double size, bool forward, bool *event, bool *terminate,
               bool *early, double *last) {
    *event = *terminate = *early = false;
    *last = time + size;
#define COPY(k, name, type) m->name[1] = m->name[0];
    TYPES(COPY)
    return 0;
}
