/* What the compiled loop works on. `structures.py` reads the structures and numbers from here.
 *
 * All arrays belong to Python, which resolves everything that does not change during a run into
 * them. Every field has 8 bytes, so that there is no padding to agree on. What one operation reads
 * lies together (fmus.Memory), the fields of each step first: the cost of a loop over many FMUs is
 * that of the cache lines that it touches.
 *
 * A comment [n] behind a pointer is the number of entries that it points to, where that is not one:
 * an expression in fields of its structure or of the one that leads there. What has no such field,
 * n_values, n_ops ..., is known to Python. `programs` writes a whole run as C by them.
 */

#ifndef LOOP_H
#define LOOP_H

#include <stddef.h>
#include <stdint.h>

/* --- FMUs ------------------------------------------------------------------------------------- */

/* Where an instance stands (s), and how often its functions were called; shared with its Python
 * object. waiting: from when on settings wait for a step. setter: the Setter whose values
 * its inputs have, 0 where that is not known. altered: calls that changed how numbers are rounded. */
typedef struct {
    double time, begin, size, end, step_time, waiting;
    int64_t ended, setter, altered, gets, sets, steps, saves, rollbacks;
} StepState;

/* What kind of number a call moves, of which version of FMI, and whether the FMU holds a Python
 * interpreter. */
typedef struct {
    int16_t type, fmi, python, unused;
} Kind;

/* A call of fmiXGet<Type> or fmiXSet<Type>: n numbers in `buffer` as the FMU has them, in `values`
 * as doubles. These are the same memory where the FMU has doubles. A cache line long. */
typedef struct {
    void *call, *fmu;
    const uint32_t *references /* [n_references] */;
    void *buffer /* [n] */;
    double *values /* [n] */;
    int64_t n_references, n;
    Kind kind;
} Transfer;

enum { DOUBLE, FLOAT, INT64, INT32, INT16, INT8, UINT64, UINT32, UINT16, UINT8, BOOL2, BOOL3 };

/* Of an FMU whose steps are checked: step_check.c. `count` of `steps` steps were, with `errors`
 * (room, n_ports) at `times`; `bases`, `rates`, `ports` and `last` are of n outputs, `scales` and
 * `jumps` of n_ports. */
typedef struct {
    void *get_state, *set_state, *state;
    int64_t *steps, *count;
    const int64_t *bases /* [n] */, *rates /* [n] */, *ports /* [n] */;
    double *scales /* [n_ports] */, *jumps /* [n_ports] */, *last /* [n] */;
    double *errors /* [room * n_ports] */, *times /* [room] */, *weights /* [room] */, *size;
    double *before /* [n_outputs] */, *halves /* [n_outputs] */;
    int64_t every, first, n, n_ports, room;
    double at_rest, jump, share;
} Check;

typedef struct {
    StepState *place;
    void *fmu, *do_step;
    Kind kind;
    int64_t forward;                      /* noSetFMUStatePriorToCurrentPoint */
    const Transfer *gets /* [n_gets] */;
    int64_t n_gets;
    double *outputs /* [n_outputs] */;
    const double *inverse /* [n_outputs] */; /* 1/bound */
    const double *factors /* [n_outputs] */, *offsets /* [n_outputs] */; /* to the units of the block that it replaces, or NULL */
    double *good /* [n_outputs] */;       /* the last finite outputs, or NULL */
    int64_t n_outputs, n_steps, untimed;  /* untimed: steps too short to be timed */
    Check *check;                         /* NULL if there is none */
    const int64_t *row_due;                /* whether the next row is written; else `gets_between_rows` suffice */
    const Transfer *gets_between_rows /* [n_gets_between_rows] */;
    int64_t n_gets_between_rows;
    void *free_state;                     /* before a state is saved over, or NULL */
    uint8_t *event, *terminate, *early;   /* FMI 3: what doStep tells */
    double *reached;
} Fmu;

/* Sets the inputs of an FMU: values[i] = factors[i] board[where[i]] + offsets[i]. `into`: where
 * they belong in `whole`, the entries of arrays that are set as a whole; NULL without arrays. `key`
 * tells the setters of an FMU apart, 0 where the FMU may change its inputs: they are then set
 * though they have not changed. */
typedef struct {
    StepState *place;
    int64_t n, key;
    const int64_t *where /* [n] */;
    double *values /* [n] */;
    const Transfer *sets /* [n_sets] */;
    int64_t n_sets;
    const double *factors /* [n] */, *offsets /* [n] */; /* NULL where all are 1 and 0 */
    const int64_t *into /* [n] */;
    double *whole;
} Setter;

/* --- holds ------------------------------------------------------------------------------------
 *
 * What stands behind the line "state:" of a structure is all that a hold goes on from: state.py
 * copies it, restores it, and reads its numbers, by these declarations alone. [n | m]: m of the n
 * entries are in use. */

/* PCG64 as NumPy has it, with a state and an increment of 128 bits each, the high words first. */
typedef struct {
    uint64_t state[2], increment[2];
} Pcg64;

/* Samples in transit: latency_and_loss.py. A sample is lost with a probability `loss`; the latency of another
 * is (low + spread u)/unit ticks, rounded up, u uniform from 0 to 1. */
typedef struct {
    int64_t low, spread, unit, room, sent, lost, overtaken;
    double loss;
    Pcg64 generator;
    /* state: */
    int64_t started, newest, n;
    int64_t *arrivals /* [room | n] */, *stamps /* [room | n] */;
    double *samples /* [room * width | n * width] */;
} Link;

/* Of a spring-damper: energy_tank.c. `velocity` is NULL where the near end has none. */
typedef struct {
    int64_t n, sampled;
    const double *stiffness /* [n] */, *damping /* [n] */, *turns /* [n] */;
    const int64_t *where /* [n] */, *velocity /* [n] */;
    double period;
    double *moved /* [n] */;
    double *least /* [1] */;              /* least energy available so far, at most 0 */
    /* state: */
    int64_t tick;
    double available, needed, credited;
    double *newest /* [2 * n] */, *modulated /* [2 * n] */;
    double *x /* [n] */, *force /* [n] */, *withheld /* [n] */;
} Tank;

/* factor board[where] + offset; factor is NULL where it is 1 and offset 0. */
typedef struct {
    const int64_t *where /* [n] */;
    const double *factor /* [n] */, *offset /* [n] */;
    int64_t n;
} Reader;

static inline double reading(const Reader *r, const double *board, int64_t i) {
    const double value = board[r->where[i]];
    return r->factor ? r->factor[i] * value + r->offset[i] : value;
}

static inline void read_all(const Reader *r, const double *board, double *into) {
    for (int64_t i = 0; i < r->n; i++) into[i] = reading(r, board, i);
}

/* Vectors with their ticks, oldest first. */
typedef struct {
    /* state: */
    int64_t count, *ticks /* [room | count] */;
    double *values /* [room * n | count * n] */;
} Queue;

/* Of a hold that observes its energy: energy_account.c, where the vectors are explained. path: of the
 * target, until: samples and until when they were held, fresh: samples that are not accounted for;
 * each has `room`. velocity has n = 0 where the target does not have it. */
typedef struct {
    int64_t n, passive, room;
    Reader displacement, velocity;
    Tank *tank;                           /* of a spring on whose far side it is, or NULL */
    double *premises /* [3] */;           /* steps of entries, those outside, energy at stake */
    double *now /* [n] */, *average /* [n] */, *at_stamp /* [n] */;
    /* state: */
    int64_t tick, stamp, steps, delayed;
    double promised, promise;
    int64_t since;                        /* of the promise */
    double *sample /* [n] */, *held /* [n] */, *x /* [n] */, *x_stamp /* [n] */;
    double *work /* [n] */, *ideal /* [n] */, *motion /* [n] */, *steady /* [n] */;
    double *predicted /* [n] */, *v /* [n] */, *gain /* [n] */, *largest /* [n] */;
    double *swing /* [n] */, *beta /* [n] */, *correction /* [n] */, *last /* [n] */;
    double *travelled /* [n] */;
    Queue path, until, fresh;
} Account;

/* A hold of any kind, the row of hold_table.h with that index. `samples`: (depth, width), oldest first;
 * `width` is 2 n where a sample is followed by its derivative or integral, more where it is by a gradient.
 * `memory`: (remembers, n), what else the kind remembers. `scratch`: since the stack is no place for arrays of any
 * size, 2 n for matrices and a sample that is unwrapped, as many and `width` for the caller, 2 n of these for the kind.
 * restart, take, give: of a hold in Python. published: when the source had its newest sample; describes: the instant
 * that this describes, which is its stamp in all that the hold does. `beside`: what the law reads beside the samples, n = 0
 * without any: the coordinates of a gradient, the efforts that move the source, both ends of a spring-damper. */
typedef struct {
    int64_t kind, n, width, depth, remembers;
    const int64_t *sources /* [width] */;
    double *held /* [n] */;               /* where `evaluate` puts the value */
    double *scratch /* [6 * n + width] */;
    int64_t n_angles;
    const int64_t *angles /* [n_angles] */;
    const double *turns /* [n_angles] */;
    Tank *tank;
    int64_t row;
    const Account *far;                   /* on the far side of the spring that it sets, or NULL */
    double *credit;                       /* where what that has put in belongs */
    int64_t manifold, rows;               /* of a matrix: its kind, its rows */
    double *chosen /* [rows] */;
    void *restart, *take, *give;
    int64_t frames;                       /* whether a sample describes the instant at which the one before was published */
    int64_t early;                        /* whether a sample is of the end of a step and known at its begin */
    int64_t relation;                     /* of what is behind the n entries of a sample of `ahead` */
    int64_t parts;                        /* steps that the target takes within one of its period */
    const double *stiffness /* [n] */, *damping /* [n] */; /* of a spring-damper, or NULL */
    Reader beside;
    /* state: */
    int64_t published, describes;
    int64_t count, stamps[3], arrival, span, interval, begun, unwrapped, rank;
    double *samples /* [depth * width | count * width] */, *memory /* [remembers * n] */;
    double *last /* [n_angles] */;        /* as they were unwrapped */
    double *scale /* [rows * (manifold == 2)] */; /* of a semidefinite matrix */
    Link *link;
    Account *account;
} Hold;

enum { NO_MATRIX, PROJECTOR, SEMIDEFINITE };
enum { ALONE, WITH_RATE, WITH_POSE };

/* --- meters, tables --------------------------------------------------------------------------- */

/* The rows of meters.c; counts: of stamps, ticks, efforts. */
typedef struct {
    Reader source, held, x;
    int64_t *counts /* [3] */, *stamps /* [room] */, *ticks /* [rows] */;
    double *samples /* [room * source.n] */, *moves /* [rows * x.n] */, *efforts /* [rows * x.n] */;
    double *totals /* [3] */;
    int64_t room, rows;                   /* there is for stamps and samples, and for the others */
    int64_t full, least;                  /* rows at which they are added up; these at least */
} Meter;

/* Of `n` signals, at `where`, or side by side from `view` on where that is NULL, each `every`-th of
 * the `count` rows so far, and the one numbered `end`, is written to `block`, (room, 1 + n) of time and
 * values, of which `rows` are filled; NULL where there is no table. due: whether the next one is. room: 0 before the
 * first. reached: time of the newest, written or not. */
typedef struct {
    double *block /* [room[0] * (1 + n)] */;
    const double *view /* [n] */;
    const int64_t *where /* [n] */;
    int64_t *rows;
    const int64_t *room;
    int64_t *due, *count;
    double *reached;
    int64_t n, every, end;
} Table;

/* --- the plan --------------------------------------------------------------------------------- */

typedef struct {
    int64_t code, a, b, c, d;
    double x;
} Op;

enum {
    PYTHON,      /* whatever has no code of its own */
    GET,         /* fmu a; b: whether outputs are judged */
    SET,         /* setter a */
    STEP,        /* fmu a; from part b of c of a tick, over d of them, x s */
    PUSH,        /* hold a; stamp b ticks ahead */
    EVALUATE,    /* hold a; x ticks ahead */
    BLEND,       /* hold a; points b to c */
    SAMPLE,      /* meter a; stamp b ticks ahead */
    MOVE,        /* meter a; b ticks ahead */
    FEED,        /* meter a; x: share of its step */
    RECORD,      /* table a */
    STOP_WHEN,   /* signal a, comparison b, limit x */
};

/* The steps of a clock's FMUs that are taken beside the loop: concurrent_fmus.py. awaited: they were not
 * done when their end came. longer: a step may go on to the first end that is not past. */
typedef struct {
    int64_t started, done, awaited, longer;
} Side;

/* The rate of a clock that was changed. Steps of ticks + rest/parts ticks would end at tick + part/parts; an end
 * is at the first haptic tick, of which each has `haptic` ticks, from there on, or from up to half of
 * `jitter` of a step before or behind it. parts: 0 where the rate is the scene's. */
typedef struct {
    int64_t ticks, rest, parts, haptic;
    double jitter;
    Pcg64 generator;
    int64_t tick, part;
} Rate;

/* A window of a clock's communication points (ticks), at the current one; `next` after its event. last: that of
 * its newest event. */
typedef struct {
    const int64_t *starts /* [n] */;
    int64_t n, at, next, last;
    Side *side;                           /* NULL where all steps are taken in the loop */
    Rate rate;
} Clock;

/* The schedule of a run in real time, and what became of it (ns): pace.py. */
typedef struct {
    int64_t (*clock)(void);
    void (*wait)(int64_t until);
    int64_t origin, most;                 /* when tick 0 is due; lateness that moves it */
    double speed;                         /* simulated time in a unit of that of the clock */
    int64_t skips;                        /* whether ticks that are past are skipped */
    int64_t reached, due, deadline, begun; /* the last tick that was waited for; of the event */
    int64_t ticks, missed, skipped, moved;
    int64_t latest, longest;
    int64_t *lateness, *steps;            /* histograms */
} Pace;

/* The operations of a kind of event. */
typedef struct {
    int64_t first, last;
} Block;

typedef struct {
    double (*points)[2] /* [n_points] */;
    double *values /* [n_values] */;
    Op *ops /* [n_ops] */;
    Fmu *fmus /* [n_fmus] */;
    Setter *setters /* [n_setters] */;
    Hold **holds /* [n_holds] */;
    Meter **meters /* [n_meters] */;
    Table *tables /* [n_tables] */;
    double numerator, denominator, begin; /* (numerator tick + begin)/denominator: the time (s) of a tick */
    int64_t late;                         /* ticks by which the event comes after its own */
} Loop;

/* Where a sequence of operations stands, and what the loop returned for. */
typedef struct {
    int64_t op, last, what, status;
} At;

typedef struct {
    Clock *clocks /* [n_clocks] */;
    int64_t n_clocks, end;
    int64_t halt;                         /* the loop returns before the first event at this tick or later; 0: never */
    int64_t *keys /* [n_kinds * (1 + n_clocks)] */; /* of the kinds */
    int64_t *key /* [1 + n_clocks] */;    /* of the current event */
    Block *kinds /* [n_kinds] */;
    int64_t n_kinds, kind;
    int64_t tick, events;                 /* events that are complete */
    int64_t patience, since;              /* ns after which, and from when, Python gets a turn */
    int64_t read, unread, stride;         /* the clock: when last, events since, and until next */
    Pace *pace;                           /* NULL: as fast as possible */
    At at;
} Events;

/* Takes a step of `n` instances at once, NULL where there is none; `taken` says which have taken it:
 * fmus/native/lanes.cpp. */
typedef void StepOfLanes(void *const *instances, int64_t n, double start, double size, int64_t *taken);

enum { MOST_LANES = 8 };

/* Runs of one plan that go through their events together: lanes.c. Which of them the loop returned for;
 * codes that others wait to return. */
typedef struct {
    int64_t n, lane;
    Loop **loops /* [n] */;
    Events **events /* [n] */;
    void **steps /* [n_fmus] */;          /* a StepOfLanes of each FMU, or NULL */
    int64_t waiting[8];
} Lanes;

/* Why the loop returns to Python. */
enum {
    DONE,
    CALL,        /* carry out this operation in Python */
    JUDGE,       /* outputs are not finite, or beyond a bound */
    FAILED,      /* call number `what` of a get or set returned `status` */
    RAISED,      /* call `what`, -1 for doStep, has left a Python exception, which ctypes raises */
    UNSAVED,     /* an FMU's state cannot be saved: `status` */
    STEPPED,     /* doStep returned `status`, asks to end or is cut short */
    UNRESTORED,  /* the state before a step that was checked could not be restored */
    STOP,        /* the condition to stop holds */
    KIND,        /* an event of a kind that is new */
    STARTS,      /* of clock `what`: its next window */
    PAUSE,
    GROW,        /* a hold, a meter or a check has no room left */
    SETTLE,      /* settings wait for a step of the FMU */
    REFUSED,     /* a hold in Python has raised an exception */
    HALT,        /* the next event is not before tick `halt` */
};

static inline double tick_time(const Loop *l, int64_t tick) { /* s */
    return ((double)tick * l->numerator + l->begin) / l->denominator;
}

/* When a step begins and ends (s): from part `first` to part `last` of `parts` of a tick each, from 0 on. */
typedef struct {
    int64_t first, last, parts;
    double begin, end;
} StepTimes;

/* Those of operation STEP at a tick, computed where they are others than those of the step before. */
static inline void locate_step(const Loop *l, const Op *op, int64_t tick, StepTimes *s) {
    const int64_t first = tick * op->c + op->b, last = first + op->d;
    if (first == s->first && last == s->last && op->c == s->parts) return;
    const double whole = l->denominator * (double)op->c, begin = l->begin * (double)op->c;
    *s = (StepTimes){first, last, op->c, ((double)first * l->numerator + begin) / whole,
                     ((double)last * l->numerator + begin) / whole};
}

#ifndef EXPORT
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
#endif

/* Of FMI: ok (0) and warning (1) are a success, and no other number is; status.py. */
static inline int fmu_succeeded(int status) {
    return status == 0 || status == 1;
}

/* Those that Python calls: library.py. */
EXPORT int hapticlink_events(Loop *l, Events *e);
EXPORT int hapticlink_lanes(Lanes *s);
EXPORT int hapticlink_block(Loop *l, At *at, int64_t tick);
EXPORT int hapticlink_push(Hold *h, const double *sample, int64_t published, int64_t arrival);
EXPORT int hapticlink_value(Hold *h, const Loop *l, int64_t tick, double ahead, double *value);
EXPORT void hapticlink_change_rate(Clock *c, const Rate *rate);
EXPORT int hapticlink_change_hold(Loop *l, int64_t place, Hold *h, int64_t stamp);
EXPORT double hapticlink_credit(const Account *a, const Loop *l);
EXPORT int hapticlink_meter_start(Meter *m, const double *board);
EXPORT int hapticlink_meter_room(Meter *m, int64_t rows);
EXPORT void hapticlink_energy(const Meter *m, double energy[5]);
EXPORT int hapticlink_check_due(Check *c, const double *outputs);
EXPORT void hapticlink_check(
    Check *c, const double *outputs, const double *halves, double time, double end, int regular
);
EXPORT void hapticlink_guard(int on); /* while it is on, exit() ends the process with status 1 */
EXPORT void hapticlink_python(int (*ensure)(void), void *(*occurred)(void), void (*release)(int));

int fmu_get(const Fmu *f, int64_t judged, At *at);
int fmu_set(const Setter *s, const double *board, At *at);
int fmu_do_step(const Fmu *f, double time, double size);
int fmu_save(const Fmu *f, void *get_state, void **state);
void fmu_begin_step(const Fmu *f, double time, double end, double size);
int fmu_end_step(Fmu *f, int status, int64_t took, At *at);
int fmu_step(Fmu *f, double time, double end, double size, At *at);
int fmu_step_with_halves(Fmu *f, double time, double end, double size, int due, At *at);
int fmu_checked_step(Fmu *f, double time, double end, double size, At *at);
int push_sample(const Loop *l, Hold *h, int64_t stamp, int64_t arrival);
int next_event(Loop *l, Events *e);
void complete_event(Events *e);
int turn_is_due_by_now(Events *e);
int further_points(Clock *c); /* of a clock whose rate was changed; 0 for others */
int meter_sample(Meter *m, const double *board, int64_t stamp);
int meter_move(Meter *m, const double *board, int64_t tick);
void meter_feed(Meter *m, const double *board, double share);
int meter_fold(Meter *m); /* adds rows to the sums and drops them; whether that made room */
/* The work (J) of the held effort so far, and that of the ideal one; the first less the second is
 * what sampling and holding have generated, which is the other's result. */
void meter_work(const Meter *m, double work[2]);
double meter_energy(const Meter *m);
int pace_wait(const Loop *l, Events *e, int64_t tick);
int pace_skip(const Loop *l, Events *e);
void pace_begin(const Loop *l, Events *e);
void pace_end(const Loop *l, Events *e, int64_t time);
int64_t now(void);
void wait_until(int64_t time);
void watch_signals(int on);
uint64_t random_bits(Pcg64 *g); /* 53 of them */
double uniform(Pcg64 *g); /* from 0 to 1 */
int signal_came(void);
int exception_left(void);
void note_arithmetic(void);      /* how numbers are rounded from here on */
void keep_arithmetic(StepState *p);  /* restored where an FMU has changed it, and counted */
double *hold_scratch(const Hold *h); /* 2 n, or a sample, of the caller of a hold */
int manifold_push(Hold *h, const double *y);
void manifold_value(const Hold *h, double *value);
double tank_share(
    Tank *t, double *effort, const double *predicted, const double *steady, const double *beta
);
int account_has_room(const Account *a, int64_t samples);

/* A kind of hold: what takes a sample, and what gives the value; both return 0 or REFUSED. A row of
 * orchestrator/holds/table.py names them, of which hold_table.h is made. */
typedef int Push(Hold *h, const double *y, int64_t stamp, int64_t arrival);
typedef int Value(Hold *h, const Loop *l, int64_t tick, double ahead, double *value);

/* x <- a^-1 x (n), by elimination with pivots; `a` is overwritten. */
void solve(double *a, double *x, int64_t n);

Push push_samples; /* keeps the newest `depth` of them */

#endif
