"""Directional derivatives of compiled FMUs in Newton's method: correct, wrong and missing ones."""

import ctypes
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from fmpy import fmi3

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.directional_derivatives import derivatives
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.results.read_results import Table
from hapticlink.orchestrator.results.run_record import Iterations
from hapticlink.orchestrator.system.system import System
from tests.little_fmus import compiled
from tests.orchestrator.coupled import NEWTON, simulate, system
from tests.orchestrator.native_mass import FLAGS, ROWS, STIFF, native, stiff
from tests.orchestrator.systems import with_coupling

STEP, WRONG, FAILING = 1.0, 2.0, 3.0
"""What an FMU offers: derivatives of its step, others, or an error."""


def iterated(folder: Path, offered: float, between: str, flags: tuple[str, ...] = FLAGS) -> System:
    """The stiff pair of masses, which takes constant inputs."""
    fmus = stiff(folder, *STIFF, flags=flags[1:], offered=offered)
    period, until = Fraction(1, 400), Fraction(1, 4)
    return system(fmus, ROWS, "iterated", period, until, between=between, iteration=NEWTON)


def solved(made: System) -> tuple[Iterations | None, Table]:
    """What was iterated, and the rows."""
    outcome, table = simulate(made)
    assert outcome.fault is None
    return outcome.details.iterations, table


@pytest.mark.parametrize("between", ["zoh", "foh"])
def test_a_steps_jacobian_is_taken_from_the_fmus(tmp_path, between):
    """Linear plants: the Jacobian told is exact, so Newton needs no differences."""
    counts, table = solved(iterated(tmp_path, STEP, between))
    plain, same = solved(iterated(tmp_path, STEP, between, FLAGS[:-1]))
    assert (counts.jacobians, counts.directional_jacobians) == (0, 1)
    assert (plain.jacobians, plain.directional_jacobians) == (1, 0)
    assert counts.max_iterations <= 3
    assert counts.iterations < plain.iterations
    assert table["one.calls"][-1] == 1
    assert table["two.calls"][-1] == 2  # one for each input
    np.testing.assert_allclose(table["one.x"], same["one.x"], rtol=0, atol=1e-8)


@pytest.mark.parametrize("offered", [WRONG, FAILING])
def test_derivatives_that_do_not_help_give_way_to_differences(tmp_path, offered):
    counts, table = solved(iterated(tmp_path, offered, "foh"))
    _, same = solved(iterated(tmp_path, STEP, "foh"))
    assert counts.jacobians >= 1
    assert counts.unconverged == 0
    np.testing.assert_allclose(table["one.x"], same["one.x"], rtol=0, atol=1e-8)


def test_where_the_jacobian_is_not_that_of_a_step_differences_are_taken(tmp_path):
    """Substeps, and feed-through read after the step with other inputs."""
    made = iterated(tmp_path, STEP, "foh")
    for other in (
        with_coupling(made, substeps={"one": 1, "two": 2}),
        with_coupling(made, get_after_set=("two",)),
    ):
        counts, table = solved(other)
        assert counts.directional_jacobians == 0
        assert counts.jacobians >= 1
        assert table["two.calls"][-1] == 0


# --- initialisation -----------------------------------------------------------------------


def looped(folder: Path, offered: float, flags: tuple[str, ...] = FLAGS, **own: float) -> System:
    """F = p (x_2 - a) + q v_2 of `two` drives `one`, whose acceleration a = F - k x_1 - c v_1 is
    the motion that `two` takes: a loop of gain -p, far from contracting."""
    values = {"warm": 0.0, "offered": offered, **own}
    fmus = {
        "one": native(folder, "one", flags, **values, x=0.3, v=0.2),
        "two": native(folder, "two", flags, **values, x=0.5, v=-0.1),
    }
    rows = [("two.F", "one.F"), ("one.a", "two.x1")]
    return system(fmus, rows, "jacobi", Fraction(1, 1000), Fraction(1, 1000))


@pytest.mark.parametrize("isolate", [False, True])
@pytest.mark.parametrize(
    ("offered", "flags", "used"),
    [(STEP, FLAGS, True), (WRONG, FLAGS, True), (FAILING, FLAGS, False), (STEP, FLAGS[:-1], False)],
)
def test_start_values_by_directional_derivatives(tmp_path, offered, flags, used, isolate):
    made = looped(tmp_path, offered, flags)
    made = replace(made, fmus=tuple(replace(u, isolate=isolate) for u in made.fmus))
    _, table = solved(made)
    p, q, k, c = 100.0, 1.0, 100.0, 1.0
    force = (p * (0.5 + k * 0.3 + c * 0.2) - q * 0.1) / (1 + p)
    assert table["two.F"][0] == pytest.approx(force, rel=1e-12)
    assert table["one.a"][0] == pytest.approx(force - k * 0.3 - c * 0.2, rel=1e-12)
    assert (table["one.calls"][0] > 0) == (table["two.calls"][0] > 0) == used


# --- FMI 3.0 ------------------------------------------------------------------------------

LINEAR = """
#include <stddef.h>
/* y[0..1] (reference 7) = A u[0..2] (5) + b w (6), z (8) = w */
int fmi3GetDirectionalDerivative(void *c, const unsigned *unknown, size_t nu, const unsigned *known,
        size_t nk, const double *seed, size_t ns, double *found, size_t nf) {
    double a[2][3] = {{1, 2, 3}, {4, 5, 6}}, b[2] = {7, 8}, u[3] = {0}, w = 0, *out = found;
    for (size_t k = 0; k < nk; k++)
        if (known[k] == 5) { for (int i = 0; i < 3; i++) u[i] = *seed++; ns -= 3; }
        else if (known[k] == 6) { w = *seed++; ns--; }
        else return 3;
    for (size_t k = 0; k < nu; k++)
        if (unknown[k] == 7) for (int i = 0; i < 2; i++, nf--)
            *out++ = a[i][0] * u[0] + a[i][1] * u[1] + a[i][2] * u[2] + b[i] * w;
        else if (unknown[k] == 8) { *out++ = w; nf--; }
    return ns || nf ? 3 : 0;
}
"""


def test_fmi3_arrays_are_derived_whole(tmp_path):
    """Of single entries of arrays, in any order; the arrays' sizes are what the standard asks."""
    source, library = tmp_path / "linear.c", tmp_path / "linear.so"
    source.write_text(LINEAR)
    library.write_bytes(compiled(source))
    ports = {"u": (5, 3), "w": (6, 1)}, {"y": (7, 2), "z": (8, 1)}
    scalars = {
        (name, i): Scalar(f"{name}[{i + 1}]", ref, "Float64", causality, None, entry=i)
        for causality, sizes in zip(("input", "output"), ports, strict=True)
        for name, (ref, size) in sizes.items()
        for i in range(size)
    }
    described = Description(Path("x.fmu"), "", "", "continuous", tuple(scalars.values()), "3")
    slave = fmi3.FMU3Slave.__new__(fmi3.FMU3Slave)
    slave.component = slave.fmiCallLogger = None
    call = ctypes.CDLL(str(library)).fmi3GetDirectionalDerivative
    call.argtypes = [ctypes.c_void_p, *(ctypes.c_void_p, ctypes.c_size_t) * 4]
    slave._functions = {"fmi3GetDirectionalDerivative": call}
    outputs = [scalars["z", 0], scalars["y", 1]]
    inputs = [scalars["u", 2], scalars["w", 0], scalars["u", 0]]
    found = derivatives(slave, described, outputs, inputs)
    np.testing.assert_array_equal(found, [[0, 1, 0], [6, 8, 4]])
    assert derivatives(slave, described, outputs, [scalars["y", 0]]) is None
