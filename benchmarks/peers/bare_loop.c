/* A ring of FMUs called from C and nothing else: set, step and get of each. */

#include <stddef.h>

typedef int (*Get)(void *, const unsigned *, size_t, double *);
typedef int (*Set)(void *, const unsigned *, size_t, const double *);
typedef int (*Step)(void *, double, double, int);

__attribute__((visibility("default"))) void ring(int n, void **fmus, Set set, Step step, Get get,
                                                 const unsigned *inputs, const unsigned *outputs,
                                                 size_t signals, double *y, long steps, double h) {
    for (long k = 0; k < steps; k++) {
        for (int i = 0; i < n; i++) set(fmus[(i + 1) % n], inputs, signals, y + signals * i);
        for (int i = 0; i < n; i++) step(fmus[i], k * h, h, 1);
        for (int i = 0; i < n; i++) get(fmus[i], outputs, signals, y + signals * i);
    }
}
