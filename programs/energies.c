/* The sums of an energy meter, where the source's samples and the target's steps are at different
 * ticks: Meter._sums and Meter._fold of orchestrator/run/energy/meter.py. */

#include "program.h"

#include <string.h>

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

static void drop(void *rows, int64_t gone, int64_t count, int64_t width) {
    memmove(rows, (char *)rows + 8 * gone * width, 8 * (count - gone) * width);
}

int meter_fold(Meter *m) {
    const int64_t n = m->x.n, efforts = m->counts[2];
    if (!m->counts[0] || !m->counts[1]) return 0;
    const Sums s = sums_of(m);
    m->totals[0] += s.held_at_row;
    m->totals[1] += s.ideal;
    if (s.peak > m->totals[2]) m->totals[2] = s.peak;
    drop(m->stamps, s.samples, m->counts[0], 1);
    drop(m->samples, s.samples, m->counts[0], n);
    drop(m->ticks, s.rows, m->counts[1], 1);
    drop(m->moves, s.rows, m->counts[1], n);
    const int64_t gone = s.rows < efforts ? s.rows : efforts;
    drop(m->efforts, gone, efforts, n);
    m->counts[0] -= s.samples;
    m->counts[1] -= s.rows;
    m->counts[2] -= gone;
    return m->counts[0] < m->room && m->counts[1] < m->full;
}
