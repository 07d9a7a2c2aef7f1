/* The rows of the energy meters: orchestrator/run/energy/meter.py. */

#include "loop.h"

#include <string.h>

static double entry(const Reader *r, const double *board, int64_t i) {
    const double value = board[r->where[i]];
    return r->factor ? r->factor[i] * value + r->offset[i] : value;
}

static void reading(const Reader *r, const double *board, double *into) {
    for (int64_t i = 0; i < r->n; i++) into[i] = entry(r, board, i);
}

/* Meter.sample; CALL where there is no room, which Python then makes. */
int meter_sample(Meter *m, const double *board, int64_t stamp) {
    int64_t *count = m->counts;
    if (!*count || m->stamps[*count - 1] != stamp) {
        if (*count == m->room) return CALL;
        m->stamps[(*count)++] = stamp;
    }
    reading(&m->source, board, m->samples + (*count - 1) * m->source.n);
    return 0;
}

/* The work of an effort over the displacement from row j to the next. */
static double work(const Meter *m, int64_t j, int ideal) {
    const int64_t n = m->x.n;
    const double *x = m->moves + j * n, *to = x + n, *held = m->efforts + j * n;
    const double *sample = m->samples + j * n, *next = sample + n;
    double sum = 0.0;
    for (int64_t i = 0; i < n; i++) {
        const double effort = ideal ? (sample[i] + next[i]) / 2 : held[i];
        const double part = effort * (to[i] - x[i]);
        sum = i ? sum + part : part;
    }
    return sum;
}

/* Drops the first `gone` of `count` rows of `width` words. */
static void drop(void *rows, int64_t gone, int64_t count, int64_t width) {
    const size_t row = 8 * width;
    memmove(rows, (char *)rows + gone * row, (count - gone) * row);
}

/* Meter._fold where the source's samples and the target's steps are at the same ticks; CALL where
 * they are not, which Python does. All of NumPy's sums here are taken one after the other. */
static int fold(Meter *m) {
    const int64_t stamps = m->counts[0], ticks = m->counts[1], efforts = m->counts[2], n = m->x.n;
    if (!stamps || m->full != m->least || efforts < ticks - 1) return CALL;
    int64_t last = 0; /* the newest sample that the target has stepped past */
    while (last < stamps && m->stamps[last] <= m->ticks[ticks - 1]) last++;
    if (!last--) return CALL;
    if (memcmp(m->stamps, m->ticks, (last + 1) * sizeof *m->stamps)) return CALL;
    if (2 * (ticks - last) > m->least) return CALL;
    double held = 0.0, ideal = 0.0, peak = 0.0;
    for (int64_t j = 0; j < last; j++) {
        held += work(m, j, 0);
        ideal += work(m, j, 1);
        const double generated = held - ideal;
        if (generated != generated) return CALL;
        if (generated > peak) peak = generated;
    }
    peak = peak + m->totals[0] - m->totals[1];
    m->totals[0] += held;
    m->totals[1] += ideal;
    if (peak > m->totals[2]) m->totals[2] = peak;
    drop(m->stamps, last, stamps, 1);
    drop(m->samples, last, stamps, n);
    drop(m->ticks, last, ticks, 1);
    drop(m->moves, last, ticks, n);
    drop(m->efforts, last < efforts ? last : efforts, efforts, n);
    m->counts[0] -= last;
    m->counts[1] -= last;
    m->counts[2] -= last < efforts ? last : efforts;
    return 0;
}

int meter_move(Meter *m, const double *board, int64_t tick) {
    int64_t *count = m->counts + 1;
    if (*count && m->ticks[*count - 1] == tick) return 0;
    if (*count >= m->full && fold(m)) return CALL;
    m->ticks[*count] = tick;
    reading(&m->x, board, m->moves + *count * m->x.n);
    ++*count;
    return 0;
}

void meter_feed(Meter *m, const double *board, double share) {
    const int64_t n = m->held.n, moves = m->counts[1];
    int64_t *count = m->counts + 2;
    const int fresh = *count < moves;
    double *row = m->efforts + (fresh ? *count : *count - 1) * n;
    for (int64_t i = 0; i < n; i++) {
        const double effort = entry(&m->held, board, i);
        const double part = share == 1.0 ? effort : effort * share;
        row[i] = fresh ? part : row[i] + part;
    }
    *count += fresh;
}
