"""Sine and cosine as arithmetic, in the place of the C library's.

Python, C, WebAssembly and vector instructions then give the same bits on every machine, and a
compiler can take several instances at a time: libraries differ in the last bit, and take one number
each.

The argument is reduced by the nearest multiple k of pi/2, in four parts (Cody and Waite, Software
Manual for the Elementary Functions, 1980): products of k with the first three are exact for k below
2^29, and what a difference loses is carried along. The rest, in two parts, goes to the polynomials
of fdlibm's k_sin.c and k_cos.c (Sun Microsystems, 1993), of errors below 2^-58. Both results are
within 1 ulp for |x| < 8e8; beyond, the products are rounded.
"""

from __future__ import annotations

from functools import cache, reduce
from typing import Any

import casadi as ca

QUARTER_TURNS = 0.6366197723675814
"""2/pi."""
PARTS = (1.570796251296997, 7.549789415861596e-08, 5.390302529957765e-15, 3.2820035428735005e-22)
"""pi/2: three parts of 24 bits and the rest."""
SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)


def sine_cosine(x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Both of a scalar, to be composed without CasADi's simplifications, which take rounding for
    nothing: the results are then off by some 1e-16."""
    k = _nearest(x * QUARTER_TURNS)
    first = (x - k * PARTS[0]) - k * PARTS[1]  # exact
    third = k * PARTS[2]
    high = first - third
    low = k * PARTS[3] - ((first - high) - third)
    r = high - low
    tail = (high - r) - low
    z = r * r
    v = z * r
    odd = _polynomial(SINE[1:], z)
    sine = r - ((z * (0.5 * tail - v * odd) - tail) - v * SINE[0])
    half = 0.5 * z
    one = 1.0 - half
    even = z * _polynomial(COSINE, z)
    cosine = one + (((1.0 - one) - half) + (z * even - r * tail))
    # Sine and cosine of k quarter turns, which are an integer from -2 to 2 but for whole turns.
    quarter = k - 4.0 * _nearest(0.25 * k)
    square = quarter * quarter
    up = (quarter * (4.0 - square)) * (1.0 / 3.0)
    along = ((1.0 - square) * (6.0 - square)) * (1.0 / 6.0)
    return along * sine + up * cosine, along * cosine - up * sine


@cache
def _both() -> ca.Function:
    """`sine_cosine` as a function: CasADi repeats it in a fraction of the time that Python takes.
    To be called first without simplifications, too."""
    x = ca.SX.sym("x")
    return ca.Function("both", [x], [*sine_cosine(x)])


def _nearest(x: ca.SX) -> ca.SX:
    """The nearest integer, as a function without slope."""
    return ca.floor(x + 0.5)


def _polynomial(coefficients: tuple[float, ...], z: ca.SX) -> ca.SX:
    return reduce(lambda value, c: c + z * value, map(ca.SX, coefficients[::-1]))


def with_own_sines(function: ca.Function) -> ca.Function:
    """A function of scalar instructions with each sine and cosine as `sine_cosine`; to be called
    without CasADi's simplifications."""
    if not function.is_a("SXFunction"):
        function = function.expand()
    codes = [function.instruction_id(k) for k in range(function.n_instructions())]
    if not {ca.OP_SIN, ca.OP_COS} & {*codes}:
        return function
    arguments = function.sx_in()
    given = [a.nonzeros() for a in arguments]
    results = [[ca.SX(0)] * function.nnz_out(i) for i in range(function.n_out())]
    work: list[Any] = [ca.SX(0)] * function.sz_w()
    known: dict[int, list[ca.SX]] = {}  # which keeps the arguments, and so their hashes
    for k, code in enumerate(codes):
        into, of = function.instruction_output(k), function.instruction_input(k)
        if code == ca.OP_CONST:
            work[into[0]] = ca.SX(function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            work[into[0]] = given[of[0]][of[1]]
        elif code == ca.OP_OUTPUT:
            results[into[0]][into[1]] = work[of[0]]
        elif code == ca.OP_CALL:
            for place, value in zip(into, _called(function, k, [work[i] for i in of]), strict=True):
                work[place] = value
        elif code in (ca.OP_SIN, ca.OP_COS):
            x = work[of[0]]
            if x.element_hash() not in known:
                known[x.element_hash()] = _both().call([x], True, False)
            work[into[0]] = known[x.element_hash()][code == ca.OP_COS]
        else:
            compose = ca.SX.unary if len(of) == 1 else ca.SX.binary
            work[into[0]] = compose(code, *(work[i] for i in of))
    made = [_filled(function.sparsity_out(i), row) for i, row in enumerate(results)]
    names = function.name_in(), function.name_out()
    return ca.Function(function.name(), arguments, made, *names, {"cse": True})


def _called(function: ca.Function, k: int, given: list[Any]) -> list[Any]:
    """What instruction k, a call, gives for the numbers that it takes."""
    called, arguments = function.instructions_sx()[k].which_function(), []
    for i in range(called.n_in()):
        n = called.nnz_in(i)
        arguments.append(_filled(called.sparsity_in(i), given[:n]))
        given = given[n:]
    return [entry for result in called.call(arguments, False, True) for entry in result.nonzeros()]


def _filled(sparsity: ca.Sparsity, entries: list[Any]) -> ca.SX:
    return ca.SX(sparsity, ca.vertcat(ca.SX(0, 1), *entries))
