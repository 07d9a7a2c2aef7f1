/* Calls of an FMU: variables read and set, a step, and saving its state. */

#include "loop.h"

#include <math.h>
#include <string.h>

enum { SHORT = 10000, ALL = 64 };
/* Steps below SHORT ns in the mean of the first ALL are not timed: reading the clock takes longer than
 * the shortest of them, and of a few that are timed none can be told for the others. */

typedef int (*Transfer2)(void *, const uint32_t *, size_t, void *);
typedef int (*Transfer3)(void *, const uint32_t *, size_t, void *, size_t);
typedef int (*DoStep2)(void *, double, double, int);
typedef int (*DoStep3)(void *, double, double, _Bool, uint8_t *, uint8_t *, uint8_t *, double *);
typedef int (*GetState)(void *, void *);

static int transferred(const Transfer *t) {
    if (t->kind.fmi == 2)
        return ((Transfer2)t->call)(t->fmu, t->references, t->n_references, t->buffer);
    return ((Transfer3)t->call)(t->fmu, t->references, t->n_references, t->buffer, t->n);
}

/* The types of whole numbers: in C, the least, and the first number beyond the largest. */
#define WHOLE(X)                                                                                   \
    X(INT64, int64_t, -9223372036854775808.0, 9223372036854775808.0)                               \
    X(INT32, int32_t, -2147483648.0, 2147483648.0)                                                 \
    X(INT16, int16_t, -32768.0, 32768.0)                                                           \
    X(INT8, int8_t, -128.0, 128.0)                                                                 \
    X(UINT64, uint64_t, 0.0, 18446744073709551616.0)                                               \
    X(UINT32, uint32_t, 0.0, 4294967296.0)                                                         \
    X(UINT16, uint16_t, 0.0, 65536.0)                                                              \
    X(UINT8, uint8_t, 0.0, 256.0)

/* Doubles from what the FMU has given; 0 where a number of 64 bits may not be exact as one. */
static int from_buffer(const Transfer *t) {
    const double exact = 9007199254740992.0;
#define FROM(kind, type, ...)                                                                      \
    case kind:                                                                                     \
        for (int64_t i = 0; i < t->n; i++) t->values[i] = (double)((type *)t->buffer)[i];          \
        break;
    switch (t->kind.type) {
        FROM(FLOAT, float)
        WHOLE(FROM)
        FROM(BOOL2, int32_t)
        FROM(BOOL3, uint8_t)
    }
    if (t->kind.type == INT64 || t->kind.type == UINT64)
        for (int64_t i = 0; i < t->n; i++)
            if (fabs(t->values[i]) >= exact) return 0;
    return 1;
}

/* The nearest numbers of the FMU's type; 0 where one is beyond its range. */
static int to_buffer(const Transfer *t) {
#define TO(kind, type, least, beyond)                                                              \
    case kind:                                                                                     \
        for (int64_t i = 0; i < t->n; i++) {                                                       \
            const double whole = rint(t->values[i]);                                               \
            if (!(whole >= least && whole < beyond)) return 0;                                     \
            ((type *)t->buffer)[i] = (type)whole;                                                  \
        }                                                                                          \
        break;
    switch (t->kind.type) {
        WHOLE(TO)
    case FLOAT:
        for (int64_t i = 0; i < t->n; i++) ((float *)t->buffer)[i] = (float)t->values[i];
        break;
    case BOOL2:
        for (int64_t i = 0; i < t->n; i++) ((int32_t *)t->buffer)[i] = t->values[i] >= 0.5;
        break;
    case BOOL3:
        for (int64_t i = 0; i < t->n; i++) ((uint8_t *)t->buffer)[i] = t->values[i] >= 0.5;
        break;
    }
    return 1;
}

/* Call number i of a get or a set. */
static inline int call(const Transfer *t, int64_t i, int64_t *count, At *at) {
    ++*count;
    at->what = i;
    at->status = transferred(t);
    if (t->kind.python && exception_left()) return RAISED;
    return fmu_succeeded(at->status) ? 0 : FAILED;
}

int fmu_get(const Fmu *f, int64_t judged, At *at) {
    const Transfer *gets = *f->row_due ? f->gets : f->gets_between_rows;
    const int64_t n = *f->row_due ? f->n_gets : f->n_gets_between_rows;
    for (int64_t i = 0; i < n; i++) {
        const int code = call(gets + i, i, &f->place->gets, at);
        if (code) return code;
        if (gets[i].kind.type != DOUBLE && !from_buffer(gets + i)) return CALL;
    }
    keep_arithmetic(f->place);
    if (f->factors)
        for (int64_t i = 0; i < f->n_outputs; i++)
            f->outputs[i] = f->factors[i] * f->outputs[i] + f->offsets[i];
    if (!judged) return 0;
    int within = 1;
    for (int64_t i = 0; i < f->n_outputs; i++)
        within &= fabs(f->outputs[i]) * f->inverse[i] <= 1.0;
    if (!within) return JUDGE;
    if (f->good) memcpy(f->good, f->outputs, f->n_outputs * sizeof(double));
    return 0;
}

/* Whether a value differs from the one before in any bit, and is now that. */
static inline int differs(double *before, double value) {
    int64_t bits[2];
    memcpy(bits, before, sizeof *before);
    memcpy(bits + 1, &value, sizeof value);
    *before = value;
    return bits[0] != bits[1];
}

int fmu_set(const Setter *s, const double *board, At *at) {
    StepState *p = s->place;
    if (p->ended) return 0;
    int differ = !s->key || p->setter != s->key;
    if (s->factors)
        for (int64_t i = 0; i < s->n; i++)
            differ |= differs(s->values + i, board[s->where[i]] * s->factors[i] + s->offsets[i]);
    else
        for (int64_t i = 0; i < s->n; i++) differ |= differs(s->values + i, board[s->where[i]]);
    if (!differ) return 0;
    if (s->into)
        for (int64_t i = 0; i < s->n; i++) s->whole[s->into[i]] = s->values[i];
    p->setter = 0;
    for (int64_t i = 0; i < s->n_sets; i++) {
        if (s->sets[i].kind.type != DOUBLE && !to_buffer(s->sets + i)) return CALL;
        const int code = call(s->sets + i, i, &p->sets, at);
        if (code) return code;
    }
    keep_arithmetic(p);
    p->setter = s->key;
    return 0;
}

int fmu_do_step(const Fmu *f, double time, double size) {
    f->place->steps++;
    const int status =
        f->kind.fmi == 2
            ? ((DoStep2)f->do_step)(f->fmu, time, size, (int)f->forward)
            : ((DoStep3)f->do_step)(f->fmu, time, size, f->forward != 0, f->event, f->terminate,
                                    f->early, f->reached);
    keep_arithmetic(f->place);
    return status;
}

/* The status of saving an FMU's state. */
int fmu_save(const Fmu *f, void *get_state, void **state) {
    f->place->saves++;
    if (f->free_state && *state) {
        ((GetState)f->free_state)(f->fmu, state);
        *state = NULL;
    }
    return ((GetState)get_state)(f->fmu, state);
}

/* Notes a step that begins. */
void fmu_begin_step(const Fmu *f, double time, double end, double size) {
    StepState *p = f->place;
    p->time = p->begin = time;
    p->size = size;
    p->end = end;
}

/* Notes how a step ended, which took `took` ns. */
int fmu_end_step(Fmu *f, int status, int64_t took, At *at) {
    StepState *p = f->place;
    at->what = -1;
    at->status = status;
    if (!f->untimed) p->step_time += 1e-9 * (double)took;
    if (f->kind.python && exception_left()) return RAISED;
    if (++f->n_steps == ALL && p->step_time < 1e-9 * SHORT * ALL) {
        f->untimed = 1;
        p->step_time = 0.0;
    }
    const int cut = f->kind.fmi == 3 && (*f->terminate || *f->early);
    if (cut || !fmu_succeeded(status)) return STEPPED;
    p->time = p->end;
    return 0;
}

int fmu_step(Fmu *f, double time, double end, double size, At *at) {
    fmu_begin_step(f, time, end, size);
    if (f->place->waiting <= time) return SETTLE;
    if (f->place->ended) return CALL;
    const int64_t begin = f->untimed ? 0 : now();
    const int status = fmu_do_step(f, time, size);
    return fmu_end_step(f, status, f->untimed ? 0 : now() - begin, at);
}
