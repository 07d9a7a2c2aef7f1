/* FMUs called from C and nothing else: set, step and get of each, in a ring, or in any system. */

#include <stddef.h>

typedef int (*Get)(void *, const unsigned *, size_t, double *);
typedef int (*Set)(void *, const unsigned *, size_t, const double *);
typedef int (*Step)(void *, double, double, int);

/* `of`: set, step, get and the FMU itself, of each of n. Steps `first` to `first + steps`; returns
 * the greatest status of a step. */
__attribute__((visibility("default"))) int ring(int n, void **of, const unsigned *inputs,
                                                const unsigned *outputs, size_t signals, double *y,
                                                long first, long steps, double h) {
    int status = 0;
    for (long k = first; k < first + steps; k++) {
        for (int i = 0; i < n; i++) {
            void **to = of + 4 * ((i + 1) % n);
            ((Set)to[0])(to[3], inputs, signals, y + signals * i);
        }
        for (int i = 0; i < n; i++) {
            const int of_step = ((Step)of[4 * i + 1])(of[4 * i + 3], k * h, h, 1);
            status = of_step > status ? of_step : status;
        }
        for (int i = 0; i < n; i++)
            ((Get)of[4 * i + 2])(of[4 * i + 3], outputs, signals, y + signals * i);
    }
    return status;
}

typedef struct {
    void *fmu;
    Set set;
    Step step;
    Get get;
    const unsigned *inputs, *outputs;
    size_t n_inputs, n_outputs;
    const long *sources;
    double *u, *y, rate;
} Bare;

/* `values` are the outputs y of all FMUs, `sources` the places of an FMU's inputs in them. An FMU
 * steps at its rate (Hz), which is at most that of the loop. Returns the greatest status. */
__attribute__((visibility("default"))) int loop(int n, Bare *fmus, const double *values,
                                                double rate, long steps) {
    int status = 0;
    for (long k = 0; k < steps; k++)
        for (int i = 0; i < n; i++) {
            Bare *f = fmus + i;
            const long at = (long)(k * f->rate / rate);
            if ((long)((k + 1) * f->rate / rate) == at) continue;
            for (size_t j = 0; j < f->n_inputs; j++) f->u[j] = values[f->sources[j]];
            if (f->n_inputs) f->set(f->fmu, f->inputs, f->n_inputs, f->u);
            const int of_step = f->step(f->fmu, at / f->rate, 1 / f->rate, 1);
            status = of_step > status ? of_step : status;
            f->get(f->fmu, f->outputs, f->n_outputs, f->y);
        }
    return status;
}
