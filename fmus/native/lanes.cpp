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

/* What the instances of the last step have, each in its lane, so that it is not gathered for every step:
 * that of `of` at a `time`, as long as it is kept_by this. z is in one of two places, the newest in `turn`. */
struct Kept {
    Number x[N_X + 1], p[N_P + 1], z[2][N_Z + 1];
    const Model *of[LANES];
    double time[LANES];
    int turn;
};
thread_local Kept kept;

int is_kept(const Kept *k, const Model *m, int lane, double start) {
    return m->kept_by == k && k->of[lane] == m && k->time[lane] == start;
}

/* Whether fmi2DoStep would take this step without a word, and without more than a step. */
int is_regular(const Model *m, double start, double size) {
    const double end = start + size, near = NEAR * size;
    return m->now.mode == STEP && !m->now.start_due && size > 0.0 && isfinite(end)
           && fabs(start - m->now.time) <= near && !(end > m->stop + near);
}

void gather(Number *into, int lane, const double *from, int n) {
    for (int i = 0; i < n; i++) into[i].v[lane] = from[i];
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

/* The step of `n` instances, NULL where there is none in a lane; `taken` says which have taken it. The
 * others, of which something is to be told or done besides, are as before. */
extern "C" __attribute__((visibility("default"))) void step_lanes(
    void *const *instances, int64_t n, double start, double size, int64_t *taken
) {
    Kept *const k = &kept;
    Number u[N_U + 1], x[N_X + 1], after[N_X + 1], y[N_Y + 1], *z = k->z[k->turn], *next = k->z[!k->turn];
    int less = -1;
    for (int l = 0; l < n; l++) {
        const Model *m = (const Model *)instances[l];
        taken[l] = 0;
        if (!m) continue;
        const int known = is_kept(k, m, l, start), leaves = leaves_out(m);
        if (less < 0) less = leaves;
        if (!is_regular(m, start, size) || leaves != less) continue;
        if (!known && N_Z && m->shared_time != start) continue;
        taken[l] = 1;
        gather(u, l, m->now.reals, N_U);
        if (known) continue;
        gather(k->x, l, m->now.x, N_X);
        gather(k->p, l, m->now.reals + N_U, N_P);
        gather(z, l, m->shared, N_Z);
    }
    Number time, h = size / SUBSTEPS, end = start + size;
    const Number *arguments[] = {x, u, k->p, &time, &h, &end, z};
    Number *results[] = {after, y, next};
    memcpy(x, k->x, N_X * sizeof *x);
    for (int i = 0; i < SUBSTEPS; i++) {
        time = start + i * size / SUBSTEPS;
        (i != WITH_OUTPUTS ? substep : less ? reduced : advance)(arguments, results, 0, 0, 0);
        memcpy(x, after, N_X * sizeof *x);
    }
    memcpy(k->x, x, N_X * sizeof *x);
    k->turn = !k->turn;
    for (int l = 0; l < LANES; l++) {
        Model *m = l < n && taken[l] ? (Model *)instances[l] : NULL;
        if (m && are_finite(x, l, N_X) && (!SAMPLED || are_finite(y, l, N_Y))) {
            scatter(x, l, m->now.x, N_X);
            scatter(y, l, m->now.reals + SETTABLE, N_Y);
            m->now.time = k->time[l] = start + size;
            m->shared_time = NAN;
            m->kept_by = k;
            m->now.output_due = 0;
            m->left_out = less;
            m->unread++;
        } else if (l < n) {
            taken[l] = 0;
            m = NULL;
        }
        k->of[l] = m;
    }
}
