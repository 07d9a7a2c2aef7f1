/* A scene as one program behind a page: its functions for WebAssembly. `m` is the run that `create`
 * returns; what can fail returns 0, and `message` says why. picture.c, generated, computes what is
 * drawn of the signals. */
#include "program.c"

#include "picture.h"

#define PAGE(name) __attribute__((export_name(#name))) name

static char cause[2200];
static int told = 1; /* whether a cause was read: the next failure has another one */
static double drawn_numbers[N_DRAWN + 1], work_done[2 * N_METERS + 1];

static void keep_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                         fmi2String category, fmi2String message, ...) {
    if (!told || status <= fmi2Warning) return; /* the first message, of the block itself, says most */
    snprintf(cause, sizeof cause, "%s", message);
    told = 0;
}

const char *PAGE(message)(void) {
    told = 1;
    return cause;
}

Model *PAGE(create)(void) {
    static const fmi2CallbackFunctions callbacks = {keep_message, calloc, free, NULL, NULL};
    return fmi2Instantiate("scene", fmi2CoSimulation, GUID, "", &callbacks, fmi2False, fmi2False);
}

void PAGE(discard)(Model *m) { fmi2FreeInstance(m); }

/* Sets an input or a parameter; it acts from the block's next step on. */
int PAGE(set)(Model *m, fmi2ValueReference reference, double value) {
    return fmi2SetReal(m, &reference, 1, &value) == fmi2OK;
}

int PAGE(begin_run)(Model *m) {
    return fmi2SetupExperiment(m, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK &&
           fmi2EnterInitializationMode(m) == fmi2OK && fmi2ExitInitializationMode(m) == fmi2OK;
}

/* All events up to the next one of the haptic clock, with it, so many times. */
int PAGE(run)(Model *m, int times) {
    const Clock *haptics = m->now.scene.events.clocks;
    if (out_of_order(m, __func__, STEP_MODE)) return 0;
    for (int i = 0; i < times; i++) {
        if (advance(m, haptics->starts[haptics->at] + 1)) continue;
        if (m->now.mode != ENDED) m->now.mode = FAILURE;
        return 0;
    }
    return 1;
}

/* Times (s) of the newest and of the next event of the haptic clock. */
double PAGE(newest)(const Model *m) { return seconds(m, m->now.scene.events.clocks->last); }

double PAGE(due)(const Model *m) {
    const Clock *haptics = m->now.scene.events.clocks;
    return seconds(m, haptics->starts[haptics->at]);
}

/* Gives a connection another hold, and a latency (us), -1 for that of the scene. */
int PAGE(hold)(Model *m, int choice, double microseconds) {
    return choose_hold(m, choice, (int64_t)microseconds);
}

/* Gives the graphics clock another rate (Hz), 0 for the scene's own steps again, and a share of each period by which it
 * varies. */
void PAGE(rate)(Model *m, double hertz, double jitter) { change_rate(m, (int64_t)rint(1e3 * hertz), jitter); }

/* --- what is shown --------------------------------------------------------------------------- */

const double *PAGE(signal_values)(const Model *m) { return m->now.scene.loop.values; }

/* Time (s) and outputs of a clock's blocks at its newest event. */
const double *PAGE(row)(const Model *m, int table) { return m->now.scene.loop.tables[table].block; }

/* The work (J) of the held effort and of the ideal one at each meter. */
const double *PAGE(work)(const Model *m) {
    for (int i = 0; i < N_METERS; i++) meter_work(m->now.scene.loop.meters[i], work_done + 2 * i);
    return work_done;
}

const double *PAGE(drawn)(const Model *m) {
    double raw[N_RAW + 1];
    for (int i = 0; i < N_RAW; i++) raw[i] = m->now.scene.loop.values[raw_places[i]];
    draw_picture(raw, drawn_numbers);
    return drawn_numbers;
}
