/* An FMI 3.0 co-simulation FMU that puts out the stop time and the tolerance that it is told, -1 for
   none, the share of the stop time that its steps have reached, and whether the newest was told that
   no earlier state will be restored. */
#include <stdbool.h>
#include <stdlib.h>

typedef struct {
    double stop, tolerance, ramp, forward;
} Model;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *required, size_t count, void *environment,
                                  void *log, void *update) {
    return calloc(1, sizeof(Model));
}
void fmi3FreeInstance(Model *m) { free(m); }
int fmi3EnterInitializationMode(Model *m, bool given, double tolerance, double start, bool stops,
                                double stop) {
    m->tolerance = given ? tolerance : -1;
    m->stop = stops ? stop : -1;
    return 0;
}
int fmi3ExitInitializationMode(Model *m) { return 0; }
int fmi3Terminate(Model *m) { return 0; }
int fmi3GetFloat64(Model *m, const unsigned *vr, size_t n, double *value, size_t size) {
    for (size_t i = 0; i < n; i++) value[i] = vr[i] < 4 ? (&m->stop)[vr[i]] : 0;
    return 0;
}
int fmi3DoStep(Model *m, double time, double size, bool no_way_back, bool *event, bool *ends,
               bool *early, double *reached) {
    m->ramp = (time + size) / m->stop;
    m->forward = no_way_back;
    *event = *ends = *early = false;
    *reached = time + size;
    return 0;
}
