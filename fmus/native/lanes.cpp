/* A step of up to LANES instances of a component at once: its functions with a vector in the place of
 * each number, an entry an instance. Every operation is that of fmi2.c, rounded alike, so that the
 * bits are the same; what vectors have no instruction for is done entry by entry.
 *
 * component.h is that of the FMU, without its conditional expressions: lane_library.py. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "fmi2Functions.h"

typedef double Vector __attribute__((vector_size(8 * LANES)));
typedef int64_t Mask __attribute__((vector_size(8 * LANES)));

struct Number {
    Vector v;
    Number() = default;
    Number(Vector w) : v(w) {}
    Number(double x) { for (int i = 0; i < LANES; i++) v[i] = x; }
};

/* 1 where a condition holds, else 0. */
static inline Number truth(Mask m) { return (Vector)(m & (Mask)Number(1.0).v); }

#define OPERATOR(op)                                                                               \
    static inline Number operator op(Number a, Number b) { return a.v op b.v; }
OPERATOR(+) OPERATOR(-) OPERATOR(*) OPERATOR(/)
#define CONDITION(op)                                                                              \
    static inline Number operator op(Number a, Number b) { return truth(a.v op b.v); }
CONDITION(<) CONDITION(<=) CONDITION(==) CONDITION(!=)

static inline Mask is_true(Number a) { return a.v != Number(0.0).v; }
static inline Number operator-(Number a) { return -a.v; }
static inline Number operator!(Number a) { return truth(~is_true(a)); }
static inline Number operator&&(Number a, Number b) { return truth(is_true(a) & is_true(b)); }
static inline Number operator||(Number a, Number b) { return truth(is_true(a) | is_true(b)); }
static inline Number chosen(Number a, Number b) { return (Vector)(is_true(a) & (Mask)b.v); }

#define OF_ONE(f)                                                                                  \
    static inline Number f(Number a) {                                                             \
        for (int i = 0; i < LANES; i++) a.v[i] = f(a.v[i]);                                        \
        return a;                                                                                  \
    }
#define OF_TWO(f)                                                                                  \
    static inline Number f(Number a, Number b) {                                                   \
        for (int i = 0; i < LANES; i++) a.v[i] = f(a.v[i], b.v[i]);                                \
        return a;                                                                                  \
    }
OF_ONE(sqrt) OF_ONE(fabs) OF_ONE(ceil) OF_ONE(exp) OF_ONE(expm1) OF_ONE(log)
OF_ONE(log1p) OF_ONE(tan) OF_ONE(asin) OF_ONE(acos) OF_ONE(atan) OF_ONE(sinh) OF_ONE(cosh)
OF_ONE(tanh) OF_ONE(asinh) OF_ONE(acosh) OF_ONE(atanh) OF_ONE(erf)
OF_TWO(atan2) OF_TWO(fmod) OF_TWO(remainder) OF_TWO(copysign) OF_TWO(fmin) OF_TWO(fmax) OF_TWO(hypot)
OF_TWO(pow)

static inline Number whole_below(Number a) { return __builtin_elementwise_floor(a.v); }

static inline double sign_of(double x) { return x < 0 ? -1 : x > 0 ? 1 : x; }
OF_ONE(sign_of)

#define casadi_real Number
#define __STDC_VERSION__ 201112L /* its helpers then call fmin, fmax and fabs */
namespace {
#include "component.h"
#include "fmi2_model.h"

#if !REDUCED
#define reduced advance /* never called */
#endif
#if SUBSTEPS == 1
#define substep advance /* never called */
#endif

int leaves_out(const Model *m) { return REDUCED && (m->unread >= RARELY || m->unread_before >= RARELY); }

/* Whether fmi2DoStep would take this step without a word, and without more than a step. */
int is_regular(const Model *m, double start, double size) {
    const double end = start + size, near = NEAR * size;
    return m->now.mode == STEP && !m->now.start_due && size > 0.0 && isfinite(end)
           && fabs(start - m->now.time) <= near && !(end > m->stop + near)
           && !(N_Z && m->shared_time != start);
}

void gather(Number *into, const double *const *from, int n) {
    for (int i = 0; i < n; i++)
        for (int l = 0; l < LANES; l++) into[i].v[l] = from[l][i];
}

void scatter(const Number *from, int lane, double *into, int n) {
    for (int i = 0; i < n; i++) into[i] = from[i].v[lane];
}

int are_finite(const Number *values, int lane, int n) {
    for (int i = 0; i < n; i++)
        if (!isfinite(values[i].v[lane])) return 0;
    return 1;
}
}

/* The step of `n` instances; `taken` says which have taken it. The others, of which something is to be
 * told or done besides, are as before. */
extern "C" __attribute__((visibility("default"))) void step_lanes(
    void *const *instances, int64_t n, double start, double size, int64_t *taken
) {
    Model *m[LANES];
    const double *x_of[LANES], *reals_of[LANES], *shared_of[LANES];
    for (int l = 0; l < LANES; l++) {
        m[l] = (Model *)instances[l < n ? l : 0];
        x_of[l] = m[l]->now.x;
        reals_of[l] = m[l]->now.reals;
        shared_of[l] = m[l]->shared;
    }
    const int less = leaves_out(m[0]);
    for (int l = 0; l < n; l++) taken[l] = is_regular(m[l], start, size) && leaves_out(m[l]) == less;
    Number x[N_X + 1], reals[SETTABLE + 1], shared[N_Z + 1], after[N_X + 1], y[N_Y + 1], next[N_Z + 1];
    Number time, h = size / SUBSTEPS, end = start + size;
    gather(x, x_of, N_X);
    gather(reals, reals_of, SETTABLE);
    gather(shared, shared_of, N_Z);
    const Number *arguments[] = {x, reals, reals + N_U, &time, &h, &end, shared};
    Number *results[] = {after, y, next};
    for (int k = 0; k < SUBSTEPS; k++) {
        time = start + k * size / SUBSTEPS;
        (k != WITH_OUTPUTS ? substep : less ? reduced : advance)(arguments, results, 0, 0, 0);
        memcpy(x, after, N_X * sizeof *x);
    }
    for (int l = 0; l < n; l++) {
        taken[l] = taken[l] && are_finite(x, l, N_X) && (!SAMPLED || are_finite(y, l, N_Y));
        if (!taken[l]) continue;
        scatter(x, l, m[l]->now.x, N_X);
        scatter(y, l, m[l]->now.reals + SETTABLE, N_Y);
        scatter(next, l, m[l]->shared, N_Z);
        m[l]->now.time = m[l]->shared_time = start + size;
        m[l]->now.output_due = 0;
        m[l]->left_out = less;
        m[l]->unread++;
    }
}
