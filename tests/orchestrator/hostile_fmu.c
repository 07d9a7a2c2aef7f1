/* A co-simulation FMU that fails or behaves badly on demand, of FMI 2.0 or, with -DFMI=3, FMI 3.0. The
   name of its instance says how: "<place>_<act>_<step>", of the places and acts below, such as
   "step_minus_20"; from that step on, for places that are called in steps. Input u, output y: y is
   the number of steps plus u. The file named by HOSTILE_FMU_LOG gets its last calls. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <fenv.h>
#include <limits.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#ifndef FMI
#define FMI 2
#endif

typedef void (*Log2)(void *, const char *, int, const char *, const char *, ...);
typedef void (*Log3)(void *, int, const char *, const char *);
typedef struct { double u, y, slope; int step, from; char place[16], act[16]; void *log, *environment; char name[64]; bool ends, early; double reached; } Model;

static void says(Model *m, const char *text) {
    if (!m->log) return;
#if FMI == 2
    ((Log2)m->log)(m->environment, m->name, 3, "error", text);
#else
    ((Log3)m->log)(m->environment, 3, "error", text);
#endif
}

static void logs(const char *call) {
    const char *path = getenv("HOSTILE_FMU_LOG");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) fprintf(file, "%s\n", call), fclose(file);
}

static void *forever(void *nothing) {
    for (;;) pause();
    return nothing;
}

static int deeper(volatile char *above) {
    volatile char here[4096];
    here[0] = above ? above[0] : 0;
    return deeper(here) + here[0];
}

/* What is done at a place; the status of the call. */
static int acts(Model *m, const char *place) {
    if (!m || strcmp(place, m->place) || m->step < m->from) return 0;
    const char *act = m->act;
#define IS(name) (!strcmp(act, name))
    if (IS("warning")) return 1;
    if (IS("discard")) return 2;
    if (IS("error")) return 3;
    if (IS("fatal")) return 4;
    if (IS("pending")) return 5;
    if (IS("minus")) return -1;
    if (IS("least")) return INT_MIN;
    if (IS("most")) return INT_MAX;
    if (IS("thirtytwo")) return 32;
    if (IS("nan")) m->y = NAN;
    if (IS("inf")) m->y = -INFINITY;
    if (IS("huge")) m->y = 1e308;
    if (IS("root") && chdir("/")) return 3;
    if (IS("gone")) {
        char path[] = "/tmp/hostile-XXXXXX";
        if (!mkdtemp(path) || chdir(path) || rmdir(path)) return 3;
    }
    if (IS("upward")) fesetround(FE_UPWARD);
    if (IS("zero")) fesetround(FE_TOWARDZERO);
#ifdef __x86_64__
    if (IS("flush")) __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
#endif
    if (IS("exit")) exit(0);
    if (IS("exit3")) exit(3);
    if (IS("leave")) _exit(0);
    if (IS("abort")) abort();
    if (IS("null")) *(volatile int *)0 = 1;
    if (IS("stack")) return deeper(NULL);
    if (IS("loop")) for (volatile int on = 1; on;) ;
    if (IS("sleep")) sleep(3600);
    if (IS("slow")) usleep(2000);
    if (IS("stdout")) close(1);
    if (IS("stderr")) close(2);
    if (IS("stdin")) close(0);
    if (IS("traps")) feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
    if (IS("alarm")) ualarm(1000, 0);
    if (IS("default")) signal(SIGINT, SIG_DFL), raise(SIGINT);
    if (IS("memory")) {
        const struct rlimit room = {(rlim_t)2 << 30, RLIM_INFINITY};
        if (setrlimit(RLIMIT_AS, &room)) return 3;
        for (size_t size = (size_t)1 << 30; size >= 4096; size /= 2) while (malloc(size)) ;
    }
    /* Ends of a step that only FMI 3 has, and the request to end that FMI 2 makes by a discard. */
    if (IS("early")) m->early = true;
    if (IS("finish") || IS("never") || IS("beyond") || IS("middle")) {
        m->ends = true;
        if (IS("never")) m->reached = NAN;
        if (IS("beyond")) m->reached = 1e300;
        return FMI == 2 ? 2 : 0;
    }
    if (IS("closed")) for (int i = 3; i < 64; i++) close(i);
    if (IS("deaf")) signal(SIGINT, SIG_IGN), signal(SIGTERM, SIG_IGN);
    if (IS("locale")) setlocale(LC_ALL, "de_DE.UTF-8");
    if (IS("prints")) for (int i = 0; i < 1000; i++) printf("%0100d\n", i);
    if (IS("nothing")) says(m, NULL);
    if (IS("format")) says(m, "%s%s%s%n%n");
    if (IS("long")) {
        char *text = malloc(1 << 20);
        memset(text, 'x', (1 << 20) - 1);
        text[(1 << 20) - 1] = 0;
        says(m, text);
        free(text);
        return 3;
    }
    if (IS("bytes")) return says(m, "\xff\xfe\x1b[2J\x07"), 3;
    if (IS("thread")) {
        pthread_t thread;
        if (pthread_create(&thread, NULL, forever, NULL)) return 3;
    }
    if (IS("child") && m->step == m->from && fork() == 0) forever(NULL);
    if (IS("term")) raise(SIGTERM);
    if (IS("int")) raise(SIGINT);
    if (IS("umask")) umask(0777);
    if (IS("small")) setrlimit(RLIMIT_FSIZE, &(struct rlimit){4096, 4096});
    if (IS("files")) setrlimit(RLIMIT_NOFILE, &(struct rlimit){4, 4});
    if (IS("environ")) clearenv();
    return 0;
}

static Model *made(const char *name, const char *guid, void *log, void *environment) {
    if (strcmp(guid, "hostile")) return NULL;
    Model *m = calloc(1, sizeof *m);
    sscanf(name, "%15[a-z]_%15[a-z0-9]_%d", m->place, m->act, &m->from);
    snprintf(m->name, sizeof m->name, "%s", name);
    m->log = log;
    m->environment = environment;
    const int from = m->from;
    m->from = 0;
    const int status = acts(m, "make");
    m->from = from;
    if (status > 1 || status < 0) return free(m), NULL;
    return m;
}

static int initial(Model *m, const char *place) {
    const int from = m->from;
    m->from = 0;
    const int status = acts(m, place);
    m->from = from;
    return status;
}

static int stepped(Model *m, double t, double h) {
    m->step++;
    m->reached = strcmp(m->act, "middle") && strcmp(m->act, "early") ? t + h : t + h / 2;
    m->y = m->step + m->u;
    /* Whose bits depend on the rounding mode. */
    m->slope += h / 3.0;
    return acts(m, "step");
}

/* One number more than was asked for. */
static void outside(const Model *m, double *beyond) {
    if (!strcmp(m->act, "outside") && m->step >= m->from) *beyond = 1e300;
}

static void freed(Model *m) { acts(m, "free"); logs("free"); free(m); }
static int terminated(Model *m) { logs("terminate"); return acts(m, "end"); }

#ifdef PYTHON /* as in pythonfmu's library: to be called once before the destructor */
static int released;
void finalizePythonInterpreter(void) { released++; }
__attribute__((destructor)) static void unload(void) {
    logs(released == 1 ? "unloaded after its interpreter" : "unloaded with its interpreter");
}
#endif

#if FMI == 2
#define UNUSED(name) int name(void) { return 3; }
typedef struct { Log2 logger; void *(*allocate)(size_t, size_t); void (*release)(void *); void *done; void *environment; } Callbacks;
UNUSED(fmi2SetDebugLogging) UNUSED(fmi2Reset) UNUSED(fmi2GetInteger) UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString) UNUSED(fmi2SetInteger) UNUSED(fmi2SetBoolean) UNUSED(fmi2SetString)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative) UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives) UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus)
UNUSED(fmi2GetIntegerStatus) UNUSED(fmi2GetStringStatus)
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const Callbacks *callbacks, int visible, int logging) {
    return made(name, guid, (void *)callbacks->logger, callbacks->environment);
}
void fmi2FreeInstance(Model *m) { freed(m); }
int fmi2SetupExperiment(Model *m, int d, double t, double a, int s, double b) { return initial(m, "setup"); }
int fmi2EnterInitializationMode(Model *m) { return initial(m, "enter"); }
int fmi2ExitInitializationMode(Model *m) { return initial(m, "leave"); }
int fmi2Terminate(Model *m) { return terminated(m); }
int fmi2GetReal(Model *m, const unsigned *vr, size_t n, double *value) {
    outside(m, value + n);
    for (size_t i = 0; i < n; i++) value[i] = vr[i] == 0 ? m->u : vr[i] == 1 ? m->y : m->slope;
    return acts(m, "get");
}
int fmi2SetReal(Model *m, const unsigned *vr, size_t n, const double *value) {
    for (size_t i = 0; i < n; i++) if (vr[i] == 0) m->u = value[i];
    return acts(m, "set");
}
int fmi2DoStep(Model *m, double t, double h, int forward) { return stepped(m, t, h); }
int fmi2GetFMUstate(Model *m, Model **state) {
    if (!*state) *state = malloc(sizeof *m);
    **state = *m;
    return acts(m, "save");
}
int fmi2SetFMUstate(Model *m, Model *state) {
    *m = *state;
    return acts(m, "restore");
}
int fmi2FreeFMUstate(Model *m, Model **state) { free(*state); *state = NULL; return acts(m, "forget"); }
int fmi2GetBooleanStatus(Model *m, int kind, int *value) { *value = m->ends; return kind == 3 ? 0 : 3; }
int fmi2GetRealStatus(Model *m, int kind, double *value) { *value = m->reached; return kind == 2 ? 0 : 3; }
#else
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *needed, size_t n, void *environment, void *log,
                                  void *update) {
    return made(name, token, log, environment);
}
void fmi3FreeInstance(Model *m) { freed(m); }
int fmi3EnterInitializationMode(Model *m, bool d, double a, double t, bool s, double b) { return initial(m, "enter"); }
int fmi3ExitInitializationMode(Model *m) { return initial(m, "leave"); }
int fmi3Terminate(Model *m) { return terminated(m); }
int fmi3GetFloat64(Model *m, const unsigned *vr, size_t n, double *value, size_t size) {
    outside(m, value + n);
    for (size_t i = 0; i < n; i++) value[i] = vr[i] == 0 ? m->u : vr[i] == 1 ? m->y : m->slope;
    return acts(m, "get");
}
int fmi3SetFloat64(Model *m, const unsigned *vr, size_t n, const double *value, size_t size) {
    for (size_t i = 0; i < n; i++) if (vr[i] == 0) m->u = value[i];
    return acts(m, "set");
}
int fmi3DoStep(Model *m, double t, double h, bool forward, bool *event, bool *end, bool *early,
               double *reached) {
    const int status = stepped(m, t, h);
    *event = false;
    *end = m->ends;
    *early = m->early;
    *reached = m->reached;
    return status;
}
int fmi3GetFMUState(Model *m, Model **state) {
    if (!*state) *state = malloc(sizeof *m);
    **state = *m;
    return acts(m, "save");
}
int fmi3SetFMUState(Model *m, Model *state) {
    *m = *state;
    return acts(m, "restore");
}
int fmi3FreeFMUState(Model *m, Model **state) { free(*state); *state = NULL; return acts(m, "forget"); }
#endif
