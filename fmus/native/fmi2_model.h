/* An instance of a component, as fmi2.c and lanes.cpp have it; behind component.h. */

static const double NEAR = 1e-3; /* share of a step by which its begin and end may be off */

enum { SETTABLE = N_U + N_P, REALS = N_U + N_P + N_Y };
enum { WITH_OUTPUTS = SAMPLED ? 0 : SUBSTEPS - 1 }; /* the substep that evaluates them */
enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, TERMINATED = 8 }; /* modes */

typedef struct { /* what fmi2GetFMUstate saves and serialises; without padding */
    char guid[40];
    long long mode, start_due, output_due; /* due: to be computed before it is read */
    double time, reals[REALS], x[N_X];
} State;

typedef struct {
    State now;
    fmi2CallbackFunctions callbacks;
    double trial[N_X], after[N_X], sample[N_Y];
    double shared[N_Z + 1], next[N_Z + 1]; /* z, and the one after a step */
    double stop;                           /* INFINITY where none is defined */
    double shared_time;                    /* for which z was evaluated; NAN: it is out of date */
    const void *kept_by;                   /* what has p, x and z in lanes.cpp; NULL: they may be others */
    int left_out;                          /* whether the last step left out outputs */
    long long unread, unread_before; /* steps since outputs on request were read, and before that */
    char name[];
} Model;
