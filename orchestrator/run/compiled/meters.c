/* The energy that sampling and holding an effort generates: work of the held effort minus work of
 * the ideal source.
 *
 * held      = sum F_held,j . (x_{j+1} - x_j)                  over the target's steps
 * ideal     = sum (F_n + F_{n+1})/2 . (x(t_{n+1}) - x(t_n))   over the source's samples
 * generated = held - ideal,   peak = the largest value of generated at any sample
 *
 * Each held effort is paired with the displacement of the step that it acts over: a spring K sampled
 * with a zero-order hold generates 1/2 K sum dx^2 (paired with the displacement before, the same
 * energy would appear dissipated). The ideal effort is linear in the displacement between samples,
 * which is exact for a spring on any path; x is linear between the target's steps. An effort that
 * changes over the substeps of a step counts with its mean.
 *
 * Rows are added to the sums from time to time: `totals` are the held work, the ideal work and the peak
 * up to the first row and sample that are kept. */

#include "loop.h"

#include <math.h>
#include <string.h>

/* The source's new sample. GROW where there is no room. */
int meter_sample(Meter *m, const double *board, int64_t stamp) {
    int64_t *count = m->counts;
    if (!*count || m->stamps[*count - 1] != stamp) {
        if (*count == m->room) return GROW;
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

/* Room for so many further rows: adds rows to the sums and drops them where there is none. GROW where a
 * slow source still needs more than there can be. */
EXPORT int hapticlink_meter_room(Meter *m, int64_t rows) {
    const int64_t *counts = m->counts;
    if (counts[1] + rows <= m->full) return 0;
    if (counts[0]) {
        const Sums s = sums_of(m);
        fold(m, &s);
    }
    const int64_t full = 2 * counts[1] > m->least ? 2 * counts[1] : m->least;
    if (full > m->rows) return GROW;
    m->full = full;
    return 0;
}

/* The energy (J) generated until now, the work of the held and that of the ideal effort, the largest
 * energy generated at any sample, and that sample's stamp (ticks), up to which all are. */
EXPORT void hapticlink_energy(const Meter *m, double energy[5]) {
    memset(energy, 0, 5 * sizeof *energy);
    if (!m->counts[0] || !m->counts[1]) return;
    const Sums s = sums_of(m);
    energy[1] = m->totals[0] + s.held;
    energy[2] = m->totals[1] + s.ideal;
    energy[0] = energy[1] - energy[2];
    energy[3] = m->totals[2] < s.peak ? s.peak : m->totals[2];
    energy[4] = (double)m->stamps[s.samples];
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
    const int code = hapticlink_meter_room(m, 1);
    if (code) return code;
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

/* The first row and sample. */
EXPORT int hapticlink_meter_start(Meter *m, const double *board) {
    const int code = meter_sample(m, board, 0);
    return code ? code : meter_move(m, board, 0);
}
