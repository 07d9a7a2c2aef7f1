/* The rows of the energy meters, which Python adds up: orchestrator/run/energy/meter.py. */

#include "loop.h"

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

int meter_move(Meter *m, const double *board, int64_t tick) {
    int64_t *count = m->counts + 1;
    if (*count && m->ticks[*count - 1] == tick) return 0;
    if (*count >= m->full) return CALL;
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
