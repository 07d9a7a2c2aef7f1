/* The rows of the energy meters and their sums: orchestrator/run/energy/meter.py. All of NumPy's sums
 * are taken here one after the other. */

#include "loop.h"

#include <math.h>
#include <string.h>

/* Meter.sample; CALL where there is no room, which Python then makes. */
int meter_sample(Meter *m, const double *board, int64_t stamp) {
    int64_t *count = m->counts;
    if (!*count || m->stamps[*count - 1] != stamp) {
        if (*count == m->room) return CALL;
        m->stamps[(*count)++] = stamp;
    }
    read_all(&m->source, board, m->samples + (*count - 1) * m->source.n);
    return 0;
}

/* Sums up to the newest sample that the target has stepped past, and how many samples and rows lie
 * before it. */
typedef struct {
    double held, held_at_row, ideal, peak;
    int64_t samples, rows;
} Sums;

/* The number of `values` in order that are at most `limit`, less one, and at least 0. */
static int64_t last_up_to(const int64_t *values, int64_t count, int64_t limit) {
    int64_t i = 0;
    while (i < count && values[i] <= limit) i++;
    return i ? i - 1 : 0;
}

/* The value at `stamp` between two rows, of which the second is used only where it is needed. */
static double between(double from, double to, int64_t tick, int64_t later, int64_t stamp) {
    if (stamp <= tick) return from;
    return (to - from) / (double)(later - tick) * (double)(stamp - tick) + from;
}

static double work(const Meter *m, int64_t row) {
    const int64_t n = m->x.n;
    double sum = 0.0;
    for (int64_t k = 0; k < n; k++) {
        const double moved = m->moves[(row + 1) * n + k] - m->moves[row * n + k];
        const double part = m->efforts[row * n + k] * moved;
        sum = k ? sum + part : part;
    }
    return sum;
}

/* Entry k of the displacement at `stamp`, which is at `row` or between it and the next. */
static double displacement(const Meter *m, int64_t row, int64_t stamp, int64_t k) {
    const int64_t n = m->x.n, next = row + 1 < m->counts[1] ? row + 1 : row;
    const double *x = m->moves + k;
    return between(x[row * n], x[next * n], m->ticks[row], m->ticks[next], stamp);
}

/* The ideal work between samples j - 1 and j, of which the first is at or behind `row_before`, the
 * second at or behind `row`. */
static double ideal(const Meter *m, int64_t j, int64_t row_before, int64_t row) {
    const int64_t n = m->x.n;
    double sum = 0.0;
    for (int64_t k = 0; k < n; k++) {
        const double effort = (m->samples[(j - 1) * n + k] + m->samples[j * n + k]) / 2;
        const double from = displacement(m, row_before, m->stamps[j - 1], k);
        const double part = effort * (displacement(m, row, m->stamps[j], k) - from);
        sum = k ? sum + part : part;
    }
    return sum;
}

static Sums sums_of(const Meter *m) {
    const int64_t ticks = m->counts[1];
    Sums s = {0};
    s.samples = last_up_to(m->stamps, m->counts[0], m->ticks[ticks - 1]);
    s.rows = last_up_to(m->ticks, ticks, m->stamps[s.samples]);
    double after = ticks > 1 ? work(m, 0) : 0.0; /* work up to the row behind `row` */
    for (int64_t j = 0, row = 0; j <= s.samples; j++) {
        const int64_t stamp = m->stamps[j], row_before = row;
        while (row + 1 < ticks && m->ticks[row + 1] <= stamp) {
            s.held_at_row = after;
            if (++row + 1 < ticks) after += work(m, row);
        }
        const int64_t next = row + 1 < ticks ? row + 1 : row;
        if (j) s.ideal += ideal(m, j, row_before, row);
        s.held = between(s.held_at_row, after, m->ticks[row], m->ticks[next], stamp);
        const double generated = s.held - s.ideal;
        if (!j || generated > s.peak) s.peak = generated;
    }
    s.peak = s.peak + m->totals[0] - m->totals[1];
    return s;
}

/* Drops the first `gone` of `count` rows of `width` words. */
static void drop(void *rows, int64_t gone, int64_t count, int64_t width) {
    const size_t row = 8 * width;
    memmove(rows, (char *)rows + gone * row, (count - gone) * row);
}

static void fold(Meter *m, const Sums *s) {
    const int64_t n = m->x.n, efforts = m->counts[2], gone = s->rows < efforts ? s->rows : efforts;
    m->totals[0] += s->held_at_row;
    m->totals[1] += s->ideal;
    if (s->peak > m->totals[2]) m->totals[2] = s->peak;
    drop(m->stamps, s->samples, m->counts[0], 1);
    drop(m->samples, s->samples, m->counts[0], n);
    drop(m->ticks, s->rows, m->counts[1], 1);
    drop(m->moves, s->rows, m->counts[1], n);
    drop(m->efforts, gone, efforts, n);
    m->counts[0] -= s->samples;
    m->counts[1] -= s->rows;
    m->counts[2] -= gone;
}

int meter_fold(Meter *m) {
    if (!m->counts[0] || !m->counts[1]) return 0;
    const Sums s = sums_of(m);
    fold(m, &s);
    return m->counts[0] < m->room && m->counts[1] < m->full;
}

/* Meter._fold; CALL where the arrays are to grow, or a sum is not finite, which Python sees to. */
static int fold_within_room(Meter *m) {
    const int64_t ticks = m->counts[1];
    if (!m->counts[0] || m->full != m->least || m->counts[2] < ticks - 1) return CALL;
    const Sums s = sums_of(m);
    if (2 * (ticks - s.rows) > m->least || !isfinite(s.held) || !isfinite(s.ideal)) return CALL;
    fold(m, &s);
    return 0;
}

void meter_work(const Meter *m, double work[2]) {
    work[0] = work[1] = 0.0;
    if (!m->counts[0] || !m->counts[1]) return;
    const Sums s = sums_of(m);
    work[0] = m->totals[0] + s.held;
    work[1] = m->totals[1] + s.ideal;
}

double meter_energy(const Meter *m) {
    double work[2];
    meter_work(m, work);
    return work[0] - work[1];
}

int meter_move(Meter *m, const double *board, int64_t tick) {
    int64_t *count = m->counts + 1;
    if (*count && m->ticks[*count - 1] == tick) return 0;
    if (*count >= m->full && fold_within_room(m)) return CALL;
    m->ticks[*count] = tick;
    read_all(&m->x, board, m->moves + *count * m->x.n);
    ++*count;
    return 0;
}

void meter_feed(Meter *m, const double *board, double share) {
    const int64_t n = m->held.n, moves = m->counts[1];
    int64_t *count = m->counts + 2;
    const int fresh = *count < moves;
    double *row = m->efforts + (fresh ? *count : *count - 1) * n;
    for (int64_t i = 0; i < n; i++) {
        const double effort = reading(&m->held, board, i);
        const double part = share == 1.0 ? effort : effort * share;
        row[i] = fresh ? part : row[i] + part;
    }
    *count += fresh;
}
