/* The force of a spring-damper between a source's motion and a target that holds it for a whole step H, as of the middle of
 * that step: by both ends of what is between them, e = x_far - x_near,
 *
 * F = K (e_0 + e_1)/2 + B (e_1 - e_0)/H
 *
 * with e_1 predicted. Both ends are moved with the mobility Lambda^-1, the near one by the spring-damper itself, the far one by
 * -F, so that over the step
 *
 * e'' = -Lambda^-1 (K e + B e' + F),   (e_1, e_1', F) = exp(H [0 1 0; -L K -L B -L; 0 0 0]) (e_0, e_0', F)
 *
 * and e_1 is linear in F. Then W = e'^T Lambda e'/2 + e^T K e does not grow over a step, whatever K, B >= 0 and H:
 * dW = - integral e'^T B e' dt - de^T B de/H.
 *
 * beside: x_far, x_near, v_far, v_near (n each), Lambda^-1 (n x n, row by row). memory: F; begun, span: since which tick,
 * until a later sample, so that what the hold is between two steps does not depend on how long ago the last one was. */

#include "loop.h"
#include "hold_table.h"

#include <math.h>
#include <string.h>

enum { MOST = 6, ROWS = 3 * MOST }; /* entries, which `assign_holds` guards */

typedef double Square[ROWS * ROWS];

static void multiply(const double *a, const double *b, double *product, int64_t n) {
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) {
            double sum = 0.0;
            for (int64_t k = 0; k < n; k++) sum += a[i * n + k] * b[k * n + j];
            product[i * n + j] = sum;
        }
}

/* a <- exp(a): Taylor's series of degree 12 of a/2^k, which is at most 1/2 in the largest row sum, squared k times. */
static void exponential(double *a, int64_t n) {
    Square sum, product;
    const size_t bytes = n * n * sizeof *a;
    double norm = 0.0;
    for (int64_t i = 0; i < n; i++) {
        double row = 0.0;
        for (int64_t j = 0; j < n; j++) row += fabs(a[i * n + j]);
        if (!(row <= norm)) norm = row;
    }
    int squared = 0;
    for (; norm > 0.5 && squared < 64; squared++) norm /= 2;
    for (int64_t i = 0; i < n * n; i++) a[i] = ldexp(a[i], -squared);
    memset(sum, 0, bytes);
    for (int degree = 12; degree >= 0; degree--) { /* sum <- 1 + a sum/(degree + 1) */
        multiply(a, sum, product, n);
        for (int64_t i = 0; i < n * n; i++) sum[i] = product[i] / (degree + 1) + (i % (n + 1) == 0);
    }
    for (; squared; squared--) {
        multiply(sum, sum, product, n);
        memcpy(sum, product, bytes);
    }
    memcpy(a, sum, bytes);
}

void solve(double *a, double *x, int64_t n) {
    for (int64_t i = 0; i < n; i++) {
        int64_t pivot = i;
        for (int64_t j = i + 1; j < n; j++)
            if (fabs(a[j * n + i]) > fabs(a[pivot * n + i])) pivot = j;
        for (int64_t k = 0; k < n; k++) {
            const double other = a[i * n + k];
            a[i * n + k] = a[pivot * n + k];
            a[pivot * n + k] = other;
        }
        const double other = x[i];
        x[i] = x[pivot];
        x[pivot] = other;
        for (int64_t j = i + 1; j < n; j++) {
            const double share = a[j * n + i] / a[i * n + i];
            for (int64_t k = i; k < n; k++) a[j * n + k] -= share * a[i * n + k];
            x[j] -= share * x[i];
        }
    }
    for (int64_t i = n - 1; i >= 0; i--) {
        for (int64_t k = i + 1; k < n; k++) x[i] -= a[i * n + k] * x[k];
        x[i] /= a[i * n + i];
    }
}

/* F (n) over a step of H (s). */
static void middle(const Hold *h, const Loop *l, double H, double *F) {
    const int64_t n = h->n, rows = 3 * n;
    const double *K = h->stiffness, *B = h->damping, *board = l->values;
    double e[MOST], rate[MOST], system[MOST * MOST];
    Square P;
    for (int64_t k = 0; k < n; k++) {
        e[k] = reading(&h->beside, board, k) - reading(&h->beside, board, n + k);
        rate[k] = reading(&h->beside, board, 2 * n + k) - reading(&h->beside, board, 3 * n + k);
    }
    memset(P, 0, rows * rows * sizeof *P);
    for (int64_t i = 0; i < n; i++) {
        P[i * rows + n + i] = H;
        for (int64_t j = 0; j < n; j++) {
            const double mobility = H * reading(&h->beside, board, 4 * n + i * n + j);
            double *row = P + (n + i) * rows + j;
            row[0] = -mobility * K[j];
            row[n] = -mobility * B[j];
            row[2 * n] = -mobility;
        }
    }
    exponential(P, rows);
    for (int64_t i = 0; i < n; i++) { /* (1 - g D) F = K e/2 - B e/H + g (A e + C e'), g = K/2 + B/H */
        const double g = K[i] / 2 + B[i] / H, *row = P + i * rows;
        F[i] = K[i] / 2 * e[i] - B[i] / H * e[i];
        for (int64_t j = 0; j < n; j++) {
            F[i] += g * (row[j] * e[j] + row[n + j] * rate[j]);
            system[i * n + j] = (i == j) - g * row[2 * n + j];
        }
    }
    solve(system, F, n);
}

int push_mid(Hold *h, const double *y, int64_t stamp, int64_t arrival) {
    if (stamp > h->span) h->begun = h->span = 0;
    return push_samples(h, y, stamp, arrival);
}

/* The same for all parts of a step, the first of which is asked for at its middle. */
int value_mid(Hold *h, const Loop *l, int64_t tick, double ahead, double *value) {
    if (!h->begun || h->span != tick) {
        const double ticks = 2.0 * (double)h->parts * (ahead + (double)l->late);
        if (ticks > 0.0)
            middle(h, l, ticks * l->numerator / l->denominator, h->memory);
        else
            memcpy(h->memory, h->samples, h->n * sizeof *value);
        h->begun = 1;
        h->span = tick;
    }
    memcpy(value, h->memory, h->n * sizeof *value);
    return 0;
}
