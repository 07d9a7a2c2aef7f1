/* An FMI 2.0 co-simulation FMU of a mass on a spring and a damper, exact for inputs that are
   constant over a step:  x'' = p a + q b - k x - c v,  F = sign (p (x - a) + q (v - b)).

   Its guid has the start values of all numbers. Inputs a, b and d, the derivative of b. Until the time `warm` it follows two such masses joined
   by p, q (side = 1: F drives it, p = 1 as an input's weight; side = 2), x = (0, 1), v = (1, 0) then.
   Beyond |x| = `brittle` a step of more than `fine` s fails: `failure` 0 gives NaN, or its status.
   `offered` 1 gives directional derivatives of a step in step mode, 2 wrong ones, 3 none. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { A, B, D, X, V, ACC, F, DF, K, C, P, Q, SIDE, WARM, SIGN, BRITTLE, FINE, FAILURE, OFFERED, CALLS, REALS };
typedef struct { double r[REALS], h; int stepped; } Model;

/* x, v after h of x'' = u - k x - c v by the Taylor series, u constant. */
static void mass(double k, double c, double u, double h, double *x, double *v) {
    double a[60] = {*x, *v}, sum = 0, slope = 0;
    for (int n = 0; n < 58; n++)
        a[n + 2] = ((n ? 0 : u) - k * a[n] - c * (n + 1) * a[n + 1]) / ((n + 1) * (n + 2));
    for (int n = 59; n > 0; n--) { sum = sum * h + a[n]; slope = slope * h + n * a[n]; }
    *x = sum * h + a[0]; *v = slope;
}
static void whole(Model *m, double t) {  /* the two masses together at t */
    double s = 1, vs = 1, d = -1, vd = 1, kc = 100, cc = 1;
    mass(100, 1, 0, t - m->r[WARM], &s, &vs);
    mass(100 + 2 * kc, 1 + 2 * cc, 0, t - m->r[WARM], &d, &vd);
    int sign = m->r[SIDE] == 1 ? 1 : -1;
    m->r[X] = (s + sign * d) / 2; m->r[V] = (vs + sign * vd) / 2;
}
static void outputs(Model *m) {
    double *r = m->r;
    r[ACC] = r[P] * r[A] + r[Q] * r[B] - r[K] * r[X] - r[C] * r[V];
    r[F] = r[SIGN] * (r[P] * (r[X] - r[A]) + r[Q] * (r[V] - r[B]));
    r[DF] = r[SIGN] * (r[P] * (r[V] - r[B]) + r[Q] * (r[ACC] - r[D]));
}

#define UNUSED(name) int name(void) { return 3; }
UNUSED(fmi2SetDebugLogging) UNUSED(fmi2Reset) UNUSED(fmi2GetInteger) UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString) UNUSED(fmi2SetInteger) UNUSED(fmi2SetBoolean) UNUSED(fmi2SetString)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2SetRealInputDerivatives) UNUSED(fmi2GetRealOutputDerivatives) UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus)
UNUSED(fmi2GetRealStatus) UNUSED(fmi2GetIntegerStatus) UNUSED(fmi2GetBooleanStatus)
UNUSED(fmi2GetStringStatus)
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    Model *m = calloc(1, sizeof(Model));
    char *at = (char *)guid;
    for (int i = 0; i < REALS; i++, at++) m->r[i] = strtod(at, &at);
    return m;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double t, double a, int s, double b) { return 0; }
int fmi2EnterInitializationMode(void *c) {
    Model *m = c;
    if (m->r[WARM] > 0) whole(m, 0);
    return 0;
}
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *value) {
    outputs(c);
    for (size_t i = 0; i < n; i++) value[i] = ((Model *)c)->r[vr[i]];
    return 0;
}
int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *value) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->r[vr[i]] = value[i];
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int discard) {
    Model *m = c;
    double *r = m->r;
    if (r[BRITTLE] > 0 && fabs(r[X]) > r[BRITTLE] && h > r[FINE]) {
        if (r[FAILURE] > 0) return (int)r[FAILURE];
        r[X] = NAN;
        return 0;
    }
    if (t < r[WARM] * (1 - 1e-9)) whole(m, t + h);
    else mass(r[K], r[C], r[P] * r[A] + r[Q] * r[B], h, &r[X], &r[V]);
    m->h = h; m->stepped = 1;
    return 0;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Model));
    memcpy(*state, c, sizeof(Model));
    return 0;
}
int fmi2SetFMUstate(void *c, void *state) {
    double calls = ((Model *)c)->r[CALLS];
    memcpy(c, state, sizeof(Model));
    ((Model *)c)->r[CALLS] = calls;
    return 0;
}
int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return 0; }

/* After a step: of the outputs at its end, by inputs held over it (section 4.1.2, f_doStep); in
   initialisation: of the instant. */
int fmi2GetDirectionalDerivative(void *c, const unsigned *unknown, size_t nu, const unsigned *known,
                                 size_t nk, const double *seed, double *found) {
    Model *m = c;
    double *r = m->r, da = 0, db = 0, dd = 0, x = 0, v = 0;
    if (r[OFFERED] == 3) return 3;
    r[CALLS] += 1;
    for (size_t i = 0; i < nk; i++) {
        if (known[i] > D) return 3;
        *(known[i] == A ? &da : known[i] == B ? &db : &dd) += seed[i];
    }
    double u = r[P] * da + r[Q] * db;
    if (m->stepped) mass(r[K], r[C], u, m->h, &x, &v);
    double acc = u - r[K] * x - r[C] * v;
    for (size_t i = 0; i < nu; i++) {
        found[i] = unknown[i] == X ? x : unknown[i] == V ? v : unknown[i] == ACC ? acc
            : unknown[i] == F ? r[SIGN] * (r[P] * (x - da) + r[Q] * (v - db))
            : unknown[i] == DF ? r[SIGN] * (r[P] * (v - db) + r[Q] * (acc - dd)) : 0;
        if (r[OFFERED] == 2) found[i] = 1 - found[i];
    }
    return 0;
}
