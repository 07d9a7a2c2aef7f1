/* An FMI 3.0 co-simulation FMU with clocks of every kind, which returns an error where the standard
   allows a call in another state only: a clock is set when it is due, and what has clocks is set
   and read while one of them is active, or in initialisation mode. Each clock counts how often it
   was active.

   sample    constant, 0.1 s from SHIFT on: held takes the input w
   told      fixed, 0.25 s, told in initialisation mode
   fired     an output: active at every third instant of sample
   go        triggered: got takes the input v, and later is due 0.02 s after it
   later     countdown
   grows     changing: due at 0.03 s, then after twice the interval before */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

enum { INITIALIZATION = 1, STEP, EVENT };
enum { SAMPLE, TOLD, FIRED, GO, LATER, GROWS, CLOCKS, W = 20, HELD, V, GOT, WHEN, PLAIN, COUNT = 30 };

typedef struct {
    int state;
    bool active[CLOCKS], ended;
    double time, w, v, held, got, when, next[CLOCKS], interval;
    int32_t count[CLOCKS];
    bool told[CLOCKS];
} Model;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *required, size_t count, void *environment,
                                  void *log, void *update) {
    Model *m = events ? calloc(1, sizeof(Model)) : NULL;
    if (!m) return NULL;
    m->next[SAMPLE] = SHIFT;
    m->next[GO] = -1; /* at any time */
    m->next[LATER] = INFINITY;
    m->interval = m->next[GROWS] = 0.03;
    return m;
}
void fmi3FreeInstance(Model *m) { free(m); }
int fmi3Terminate(Model *m) { return m->state >= STEP ? 0 : 3; }
int fmi3EnterInitializationMode(Model *m, bool given, double tolerance, double start, bool stops,
                                double stop) {
    m->state = INITIALIZATION;
    m->time = start;
    for (int k = 0; k < CLOCKS; k++) /* the first instant of a clock is told from the start on */
        if (k != GO) m->next[k] += start;
    return 0;
}
int fmi3ExitInitializationMode(Model *m) {
    if (m->state != INITIALIZATION || !m->told[TOLD] || !m->told[GROWS]) return 3;
    m->state = EVENT;
    return 0;
}
int fmi3EnterEventMode(Model *m) {
    if (m->state != STEP) return 3;
    m->state = EVENT;
    m->ended = false;
    m->told[LATER] = false;
    return 0;
}
int fmi3GetIntervalDecimal(Model *m, const unsigned *vr, size_t n, double *value, int *qualifier) {
    if (n != 1 || m->state == STEP) return 3;
    *qualifier = vr[0] == LATER && (isinf(m->next[LATER]) || m->told[LATER]) ? 0 : 2;
    *value = vr[0] == TOLD ? 0.25 : vr[0] == GROWS ? m->interval : 0.02;
    m->told[vr[0]] = true;
    return vr[0] == TOLD || vr[0] == LATER || vr[0] == GROWS ? 0 : 3;
}
int fmi3GetShiftDecimal(Model *m, const unsigned *vr, size_t n, double *value) {
    *value = 0;
    return m->state == INITIALIZATION && vr[0] == TOLD ? 0 : 3;
}
int fmi3SetClock(Model *m, const unsigned *vr, size_t n, const bool *value) {
    if (m->state != EVENT) return 3;
    for (size_t i = 0; i < n; i++) {
        unsigned k = vr[i];
        if (k >= CLOCKS || k == FIRED || !value[i]) return 3;
        if (k != GO && fabs(m->next[k] - m->time) > 1e-9) return 3;
        m->active[k] = true;
        m->count[k]++;
        if (k == SAMPLE && m->count[k] % 3 == 0) m->active[FIRED] = true, m->count[FIRED]++;
        if (k == LATER) m->when = m->time;
    }
    return 0;
}
int fmi3GetClock(Model *m, const unsigned *vr, size_t n, bool *value) {
    *value = m->active[vr[0]];
    return m->state == EVENT && n == 1 && vr[0] == FIRED ? 0 : 3;
}
int fmi3UpdateDiscreteStates(Model *m, bool *more, bool *ends, bool *nominals, bool *values,
                             bool *defined, double *next) {
    if (m->state != EVENT) return 3;
    if (m->active[SAMPLE]) m->next[SAMPLE] += 0.1;
    if (m->active[TOLD]) m->next[TOLD] += 0.25;
    if (m->active[LATER]) m->next[LATER] = INFINITY;
    if (m->active[GROWS]) m->interval *= 2, m->next[GROWS] += m->interval, m->told[GROWS] = false;
    if (m->active[GO]) m->next[LATER] = m->time + 0.02, m->told[LATER] = false;
    for (int k = 0; k < CLOCKS; k++) m->active[k] = false;
    *more = *ends = *nominals = *values = *defined = false;
    m->ended = true;
    return 0;
}
int fmi3EnterStepMode(Model *m) {
    if (m->state != EVENT || !m->ended || !m->told[GROWS]) return 3;
    m->state = STEP;
    return 0;
}
static bool barred(Model *m, int clock) { return m->state != INITIALIZATION && !m->active[clock]; }

int fmi3GetFloat64(Model *m, const unsigned *vr, size_t n, double *value, size_t size) {
    for (size_t i = 0; i < n; i++) {
        int clock = vr[i] == HELD ? SAMPLE : vr[i] == GOT ? GO : LATER;
        if (vr[i] != PLAIN && barred(m, clock)) return 3;
        value[i] = vr[i] == HELD ? m->held = m->w : vr[i] == GOT ? m->got = m->v
                 : vr[i] == WHEN ? m->when : m->time;
    }
    return 0;
}
int fmi3SetFloat64(Model *m, const unsigned *vr, size_t n, const double *value, size_t size) {
    for (size_t i = 0; i < n; i++) {
        if (barred(m, vr[i] == W ? SAMPLE : GO)) return 3;
        *(vr[i] == W ? &m->w : &m->v) = value[i];
    }
    return 0;
}
int fmi3GetInt32(Model *m, const unsigned *vr, size_t n, int32_t *value, size_t size) {
    for (size_t i = 0; i < n; i++) {
        if (barred(m, (int)vr[i] - COUNT)) return 3;
        value[i] = m->count[vr[i] - COUNT];
    }
    return 0;
}
int fmi3DoStep(Model *m, double time, double size, bool forward, bool *event, bool *ends,
               bool *early, double *last) {
    if (m->state != STEP || fabs(time - m->time) > 1e-9 || size <= 0) return 3;
    *event = *ends = *early = false;
    m->time = *last = time + size;
    for (int k = 0; k < CLOCKS; k++) /* no clock was passed over */
        if (k != GO && k != FIRED && m->next[k] < m->time - 1e-9) return 3;
    return 0;
}
