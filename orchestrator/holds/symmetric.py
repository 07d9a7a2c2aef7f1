"""Eigenvalues and eigenvectors of a small symmetric matrix, by Jacobi's method with cyclic order
(Golub and Van Loan, Matrix Computations, 4th edition, section 8.5.3).

The operations and their order are fixed, unlike those of LAPACK, whose bits depend on its build:
`orchestrator/run/compiled/manifolds.c` does the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

SWEEPS = 32
"""At most; 10 x 10 takes about 6."""
SMALL = 2.0**-53
"""Off-diagonal entries count as 0 up to this share of the largest entry."""
Rows = list[list[float]]


def eigen(matrix: Sequence[Sequence[float]]) -> tuple[list[float], Rows]:
    """The eigenvalues, in no order, and the matrix whose columns are the eigenvectors, orthonormal.
    Of `matrix` (n, n), symmetric."""
    a, n = [list(row) for row in matrix], len(matrix)
    v = [[float(i == j) for j in range(n)] for i in range(n)]
    largest = 0.0
    for row in a:
        for entry in row:
            if abs(entry) > largest:
                largest = abs(entry)
    rotated, sweep = True, 0
    while rotated and sweep < SWEEPS:
        rotated, sweep = False, sweep + 1
        for p in range(n - 1):
            for q in range(p + 1, n):
                if abs(a[p][q]) > SMALL * largest:
                    _rotate(a, v, p, q)
                    rotated = True
    return [a[i][i] for i in range(n)], v


def _rotate(a: Rows, v: Rows, p: int, q: int) -> None:
    """a <- J^T a J and v <- v J, with the rotation J of p and q that makes a[p][q] zero."""
    theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q])
    t = 1.0 / (abs(theta) + sqrt(theta * theta + 1.0))
    if theta < 0.0:
        t = -t
    c = 1.0 / sqrt(t * t + 1.0)
    s = t * c
    for rows in (a, v):
        for row in rows:
            x, y = row[p], row[q]
            row[p], row[q] = c * x - s * y, s * x + c * y
    at_p, at_q = a[p], a[q]
    for k, (x, y) in enumerate(zip(at_p, at_q, strict=True)):
        at_p[k], at_q[k] = c * x - s * y, s * x + c * y
    a[p][q] = a[q][p] = 0.0
