/* What all holds have: angles that are unwrapped, matrices, samples in transit, and holds of plugins,
 * which are called back. */

#include "loop.h"
#include "hold_table.h"

#include <math.h>
#include <string.h>

static const struct {
    Push *push;
    Value *value;
} KINDS[] = {HOLD_TABLE};

double *hold_scratch(const Hold *h) { return h->scratch + 2 * h->n; }

/* --- of a plugin ---------------------------------------------------------------------------------- */

typedef int (*Restart)(void);
typedef int (*Take)(int64_t stamp, const double *y, int64_t arrival);
typedef int (*Give)(int64_t tick, double ahead, double *value);

int push_in_python(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    return ((Take)h->take)(stamp, y, arrival) ? REFUSED : 0;
}

int value_in_python(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    (void)l;
    return ((Give)h->give)(tick, ahead, value) ? REFUSED : 0;
}

/* --- all kinds -------------------------------------------------------------------------------- */

/* An angle (rad, deg, ...) that its FMU wraps: each sample is unwrapped by whole turns relative to the
 * sample before. `y` is the caller's to change. */
static void unwrap(Hold *h, double *y) {
    for (int64_t i = 0; i < h->n_angles; i++) {
        double *angle = y + h->angles[i];
        if (h->unwrapped) *angle += h->turns[i] * rint((h->last[i] - *angle) / h->turns[i]);
        h->last[i] = *angle;
    }
    h->unwrapped = 1;
}

/* As if there had been no sample yet. */
static int restart(Hold *h) {
    h->count = h->arrival = h->span = h->interval = h->begun = 0;
    memset(h->memory, 0, h->remembers * h->n * sizeof *h->memory);
    return h->restart && ((Restart)h->restart)() ? REFUSED : 0;
}

static int push(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    if (h->n_angles) {
        double *own = h->scratch;
        memcpy(own, y, h->width * sizeof *y);
        unwrap(h, own);
        y = own;
    }
    if (h->manifold && manifold_push(h, y) && restart(h)) return REFUSED;
    return KINDS[h->kind].push(h, y, stamp, arrival);
}

/* The next latency (ticks), -1 for a lost sample. All but the loss are whole numbers. */
static int64_t draw(Link *k) {
    const uint64_t share = random_bits(&k->generator), luck = random_bits(&k->generator);
    if ((double)luck * 0x1p-53 < k->loss) return -1;
    /* ceil(N / (unit 2^53)), N = low 2^53 + spread share. A division of 128 bits would call a
     * function of the compiler's library, which a program lacks. */
    const __uint128_t product = (__uint128_t)k->spread * share;
    const uint64_t whole = (uint64_t)k->low + (uint64_t)(product >> 53), unit = (uint64_t)k->unit;
    const uint64_t rest = (uint64_t)product & ((1ull << 53) - 1);
    return (int64_t)(whole / unit + (whole % unit || rest));
}

/* A sample goes on its way `late` after it was published, in the order of (arrival, stamp). */
static int send(Link *k, const double *y, int64_t width, int64_t stamp, int64_t published, int64_t from) {
    if (k->n == k->room) return GROW;
    const int64_t late = draw(k);
    k->sent++;
    if (late < 0) {
        k->lost++;
        return 0;
    }
    const int64_t arrival = published + late > from ? published + late : from;
    int64_t i = k->n++;
    for (; i > 0; i--) {
        const int64_t a = k->arrivals[i - 1], s = k->stamps[i - 1];
        if (a < arrival || (a == arrival && s <= stamp)) break;
        k->arrivals[i] = a;
        k->stamps[i] = s;
        memcpy(k->samples + i * width, k->samples + (i - 1) * width, width * sizeof *y);
    }
    k->arrivals[i] = arrival;
    k->stamps[i] = stamp;
    memcpy(k->samples + i * width, y, width * sizeof *y);
    return 0;
}

/* Takes the samples that have arrived; one that comes after a newer one is dropped. */
static int receive(Hold *h, int64_t tick) {
    Link *k = h->link;
    int64_t gone = 0;
    for (; gone < k->n && k->arrivals[gone] <= tick; gone++) {
        if (k->stamps[gone] < k->newest) {
            k->overtaken++;
            continue;
        }
        k->newest = k->stamps[gone];
        if (push(h, k->samples + gone * h->width, k->stamps[gone], k->arrivals[gone])) return REFUSED;
    }
    if (!gone) return 0;
    k->n -= gone;
    memmove(k->arrivals, k->arrivals + gone, k->n * sizeof *k->arrivals);
    memmove(k->stamps, k->stamps + gone, k->n * sizeof *k->stamps);
    memmove(k->samples, k->samples + gone * h->width, k->n * h->width * sizeof *k->samples);
    return 0;
}

/* The instant that a sample describes which its source has at `published`: a frame begins where the one before ends. */
static int64_t described(Hold *h, int64_t published) {
    if (h->published != published) {
        h->describes = h->frames ? h->published : published;
        h->published = published;
    }
    return h->describes;
}

EXPORT int hapticlink_push(Hold *h, const double *y, int64_t published, int64_t arrival) {
    const int64_t stamp = described(h, published);
    if (h->link && h->link->started) return send(h->link, y, h->width, stamp, h->early ? arrival : published, arrival);
    if (h->account && !account_has_room(h->account, 1)) return GROW;
    if (h->link) h->link->started = 1;
    return push(h, y, stamp, arrival);
}

EXPORT int hapticlink_value(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    if (h->account && !account_has_room(h->account, h->link ? h->link->n : 0)) return GROW;
    if (h->link && receive(h, tick)) return REFUSED;
    if (KINDS[h->kind].value(h, l, tick, ahead, value)) return REFUSED;
    if (h->manifold) manifold_value(h, value);
    return 0;
}
