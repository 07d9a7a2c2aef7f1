/* Holds on manifolds: signals whose entries cannot be extrapolated independently.
 *
 * projector: a symmetric matrix with eigenvalues 0 and 1. The extrapolated matrix is replaced by the
 * nearest projector of the same rank, onto the eigenvectors of its largest eigenvalues (Fan and
 * Hoffman 1955). When the rank changes, the hold starts anew from the new sample.
 *
 * semidefinite: a symmetric matrix with no negative eigenvalue (Lambda^-1, an inertia). The negative
 * eigenvalues of the extrapolated matrix are set to 0, in coordinates scaled by the newest sample's
 * diagonal, so that the result does not depend on units.
 *
 * angle: an angle (rad, deg, ...) that its FMU wraps. Each sample is unwrapped by whole turns relative
 * to the sample before.
 *
 * Matrices behind a hold that only returns samples (`gives_samples`) need none of this. Eigenvalues and
 * eigenvectors are found by Jacobi's method with cyclic order (Golub and Van Loan, Matrix Computations, 4th
 * edition, section 8.5.3), whose operations and their order are fixed, unlike those of LAPACK. Angles are
 * unwrapped in holds.c. `scratch` has room for two matrices here, and for two more of the caller. */

#include "loop.h"

#include <math.h>
#include <string.h>

enum { SWEEPS = 32 }; /* at most; 10 x 10 takes about 6 */

/* a <- J^T a J and v <- v J, with the rotation J of p and q that makes a[p][q] zero. */
static void rotate(double *a, double *v, int64_t n, int64_t p, int64_t q) {
    const double theta = (a[q * n + q] - a[p * n + p]) / (2.0 * a[p * n + q]);
    double t = 1.0 / (fabs(theta) + sqrt(theta * theta + 1.0));
    if (theta < 0.0) t = -t;
    const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
    double *const both[] = {a, v};
    for (int m = 0; m < 2; m++)
        for (double *row = both[m]; row < both[m] + n * n; row += n) {
            const double x = row[p], y = row[q];
            row[p] = c * x - s * y;
            row[q] = s * x + c * y;
        }
    for (int64_t k = 0; k < n; k++) {
        const double x = a[p * n + k], y = a[q * n + k];
        a[p * n + k] = c * x - s * y;
        a[q * n + k] = s * x + c * y;
    }
    a[p * n + q] = a[q * n + p] = 0.0;
}

/* `a` gets the eigenvalues on its diagonal, `v` the eigenvectors as columns. Off-diagonal entries
 * count as 0 up to 2^-53 of the largest entry. */
static void eigen(double *a, double *v, int64_t n) {
    double largest = 0.0;
    for (int64_t i = 0; i < n * n; i++) {
        v[i] = i % (n + 1) == 0;
        if (fabs(a[i]) > largest) largest = fabs(a[i]);
    }
    int rotated = 1;
    for (int sweep = 0; rotated && sweep < SWEEPS; sweep++) {
        rotated = 0;
        for (int64_t p = 0; p < n - 1; p++)
            for (int64_t q = p + 1; q < n; q++)
                if (fabs(a[p * n + q]) > 0x1p-53 * largest) {
                    rotate(a, v, n, p, q);
                    rotated = 1;
                }
    }
}

/* Row i times row j of `v`, of the columns that are `chosen`. */
static double product(const double *v, const double *chosen, int64_t n, int64_t i, int64_t j) {
    double sum = 0.0;
    for (int64_t k = 0; k < n; k++)
        if (chosen[k] != 0.0) sum += v[i * n + k] * v[j * n + k];
    return sum;
}

static void projector(const Hold *h, double *a, double *v, double *value) {
    const int64_t n = h->rows;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) a[i * n + j] = (value[i * n + j] + value[j * n + i]) / 2;
    eigen(a, v, n);
    for (int64_t k = 0; k < n; k++) {
        int64_t before = 0;
        for (int64_t i = 0; i < n; i++) {
            const double one = a[i * n + i], own = a[k * n + k];
            before += one > own || (one == own && i < k);
        }
        h->chosen[k] = before < h->rank;
    }
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) value[i * n + j] = product(v, h->chosen, n, i, j);
}

static void semidefinite(const Hold *h, double *a, double *v, double *value) {
    const int64_t n = h->rows;
    const double *scale = h->scale;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++)
            a[i * n + j] = (value[i * n + j] + value[j * n + i]) / (2 * (scale[i] * scale[j]));
    eigen(a, v, n);
    for (int64_t k = 0; k < n; k++) {
        const double root = sqrt(a[k * n + k] > 0.0 ? a[k * n + k] : 0.0);
        for (int64_t i = 0; i < n; i++) v[i * n + k] *= root;
        h->chosen[k] = 1.0;
    }
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++)
            value[i * n + j] = product(v, h->chosen, n, i, j) * (scale[i] * scale[j]);
}

/* Notes the rank or the scale of a sample; whether the hold starts anew from it. */
int manifold_push(Hold *h, const double *y) {
    const int64_t n = h->rows;
    if (h->manifold == SEMIDEFINITE) {
        for (int64_t i = 0; i < n; i++) {
            const double size = sqrt(fabs(y[i * (n + 1)]));
            h->scale[i] = size > 0.0 ? size : 1.0;
        }
        return 0;
    }
    double trace = 0.0;
    for (int64_t i = 0; i < n; i++) trace += y[i * (n + 1)];
    const int64_t before = h->rank;
    h->rank = (int64_t)rint(trace > 0.0 ? (trace < n ? trace : n) : 0.0);
    return h->rank != before;
}

void manifold_value(const Hold *h, double *value) {
    double *a = h->scratch, *v = h->scratch + h->n;
    (h->manifold == SEMIDEFINITE ? semidefinite : projector)(h, a, v, value);
}
