/* An FMI 3.0 co-simulation FMU with event mode, which returns an error where the standard allows a
   call in another state only. x rises at a rate of 1 + u; where it reaches 1 it falls to 0 in event
   mode, in the second of two iterations, and `falls` counts. A time event each 0.3 s counts in
   `alarms`. `level` is a discrete input that is added to x where it changes. `parts` counts doStep.
   With `mode` 1 it returns early unasked, with 2 its events never settle, with 3 it asks to end at
   its first fall, with 4 it returns early without advancing, with 5 it asks to end at
   t = 0. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { INSTANTIATED, INITIALIZATION, STEP, EVENT, TERMINATED };
enum { X = 1, U, FALLS, ALARMS, LEVEL, PARTS, MODE, EVENTS };

typedef struct {
    int state, phase; /* phase: 0 nothing to do, 1 to fall, 2 fallen and not settled */
    bool events, early, due;
    double x, u, time, alarm;
    int32_t level, before, mode, falls, alarms, parts, entered;
} Model;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *required, size_t count, void *environment,
                                  void *log, void *update) {
    if (events && !strcmp(token, "{refuses}")) return NULL;
    Model *m = calloc(1, sizeof(Model));
    m->events = events;
    m->early = early;
    m->alarm = 0.3;
    return m;
}
void fmi3FreeInstance(Model *m) { free(m); }
int fmi3Terminate(Model *m) { return m->state == STEP || m->state == EVENT ? 0 : 3; }
int fmi3EnterInitializationMode(Model *m, bool given, double tolerance, double start, bool stops,
                                double stop) {
    m->state = INITIALIZATION;
    return 0;
}
int fmi3ExitInitializationMode(Model *m) {
    if (m->state != INITIALIZATION) return 3;
    m->before = m->level;
    m->state = m->events ? EVENT : STEP;
    m->due = m->events;
    return 0;
}
int fmi3EnterEventMode(Model *m) {
    if (m->state != STEP || !m->events) return 3;
    m->state = EVENT;
    m->due = true; /* an update at least once */
    m->entered++;
    return 0;
}
int fmi3UpdateDiscreteStates(Model *m, bool *more, bool *ends, bool *nominals, bool *values,
                             bool *defined, double *next) {
    if (m->state != EVENT) return 3;
    *nominals = *values = false;
    *ends = m->mode == 5;
    if (m->phase == 1) {
        m->phase = 2;
        if (m->mode == 3) *ends = true;
    } else if (m->phase == 2) {
        m->x -= 1;
        m->falls++;
        m->phase = 0;
    }
    m->x += m->level - m->before;
    m->before = m->level;
    if (m->time >= m->alarm - 1e-9) {
        m->alarms++;
        m->alarm += 0.3;
    }
    *more = m->due = m->phase != 0 || (m->mode == 2 && m->time > 0);
    *defined = true;
    *next = m->alarm;
    return 0;
}
int fmi3EnterStepMode(Model *m) {
    if (m->state != EVENT || m->due) return 3;
    m->state = STEP;
    return 0;
}
int fmi3GetFloat64(Model *m, const unsigned *vr, size_t n, double *value, size_t size) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != X) return 3;
        value[i] = m->x;
    }
    return 0;
}
int fmi3SetFloat64(Model *m, const unsigned *vr, size_t n, const double *value, size_t size) {
    if (n != 1 || vr[0] != U) return 3;
    m->u = value[0];
    return 0;
}
int fmi3GetInt32(Model *m, const unsigned *vr, size_t n, int32_t *value, size_t size) {
    for (size_t i = 0; i < n; i++)
        value[i] = vr[i] == FALLS ? m->falls : vr[i] == ALARMS ? m->alarms
                 : vr[i] == PARTS ? m->parts : m->entered;
    return 0;
}
int fmi3SetInt32(Model *m, const unsigned *vr, size_t n, const int32_t *value, size_t size) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == LEVEL && m->state != STEP) m->level = value[i];
        else if (vr[i] == MODE && m->state < STEP) m->mode = value[i];
        else return 3;
    }
    return 0;
}
int fmi3DoStep(Model *m, double time, double size, bool forward, bool *event, bool *ends,
               bool *early, double *last) {
    double end = time + size, rate = 1 + m->u, crossing = m->time + (1 - m->x) / rate;
    if (m->state != STEP || m->due || fabs(time - m->time) > 1e-9 || size <= 0) return 3;
    if (m->phase || (m->events && m->early && end > m->alarm + 1e-9)) return 3;
    *event = *ends = *early = false;
    m->parts++;
    if (m->mode == 4 || m->mode == 1) {
        *early = true;
        *last = m->mode == 4 ? time : end;
        m->time = *last;
        return 0;
    }
    if (m->events && crossing < end - 1e-9 && m->early) {
        *early = true;
        end = crossing;
    }
    m->x += rate * (end - m->time);
    m->time = *last = end;
    if (m->x >= 1 - 1e-9) {
        if (m->events) *event = m->phase = 1;
        else m->x -= 1, m->falls++;
    }
    return 0;
}
typedef Model State;
int fmi3GetFMUState(Model *m, State **state) {
    if (m->state != STEP) return 3;
    if (!*state) *state = malloc(sizeof(Model));
    **state = *m;
    return 0;
}
int fmi3SetFMUState(Model *m, State *state) { *m = *state; return 0; }
int fmi3FreeFMUState(Model *m, State **state) { free(*state); *state = NULL; return 0; }
int fmi3SerializedFMUStateSize(Model *m, State *state, size_t *size) { *size = sizeof *state; return 0; }
int fmi3SerializeFMUState(Model *m, State *state, uint8_t *bytes, size_t size) {
    memcpy(bytes, state, size);
    return 0;
}
int fmi3DeserializeFMUState(Model *m, const uint8_t *bytes, size_t size, State **state) {
    *state = malloc(sizeof(Model));
    memcpy(*state, bytes, size);
    return 0;
}
