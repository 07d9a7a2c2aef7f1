"""Tables, splines and sines of time: against NumPy, SciPy and the table; Python text against
CasADi."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hapticlink.components.paths import TimeSine, TimeSpline, TimeTable
from hapticlink.components.specs.paths import PoseSine
from hapticlink.components.time_signals import at, over, size_over, within
from hapticlink.fmus.straight_line import program


def table(rng: np.random.Generator, rows: int, columns: int) -> tuple[tuple[float, ...], ...]:
    times = np.cumsum(rng.uniform(1e-3, 1.0, rows)) - 1.0
    return tuple(map(tuple, np.column_stack([times, rng.normal(size=(rows, columns))]).tolist()))


def look_up(*paths: Any) -> ca.Function:
    """t -> the values of the paths, and their rates."""
    t = ca.SX.sym("t")
    return ca.Function("look_up", [t], [at(paths, t)])


SIZES = pytest.mark.parametrize(("rows", "columns"), [(1, 2), (2, 1), (3, 3), (1000, 2)])


@SIZES
def test_value_and_rate_at_any_instant(rows: int, columns: int) -> None:
    rng = np.random.default_rng(rows)
    path = TimeTable(table(rng, rows, columns), "table")
    data, function = np.array(path.rows), look_up(path)
    middles = rng.uniform(data[0, 0] - 1, data[-1, 0] + 1, 200)
    for instant in [*data[:, 0], *middles]:
        found = np.array(function(instant)).ravel()
        values = [np.interp(instant, data[:, 0], column) for column in data[:, 1:].T]
        np.testing.assert_allclose(found[:columns], values, rtol=1e-12, atol=1e-14)
        k = np.searchsorted(data[:, 0], instant, "right") - 1  # the segment that begins here
        rate = np.zeros(columns)
        if 0 <= k < rows - 1:
            rate = (data[k + 1, 1:] - data[k, 1:]) / (data[k + 1, 0] - data[k, 0])
        np.testing.assert_allclose(found[columns:], rate, rtol=1e-12)


def test_a_step_between_rows_takes_the_table_itself() -> None:
    """With the left limit of the rate at its end, wherever rounding puts that end."""
    tables = [
        TimeTable(((0.0, 1.0), (0.1, 3.0), (0.3, -1.0)), "one"),
        TimeTable(((0.1, 0.0, 2.0), (0.2, 1.0, 5.0)), "two"),
    ]
    t, h, when = (ca.SX.sym(name) for name in ("t", "h", "when"))
    curves = ca.SX.sym("curves", size_over(tables))
    inside = ca.Function("inside", [curves, when], [within(tables, curves, when)])
    step = ca.Function("step", [t, h, when], [inside(over(tables, t, h), when)])
    for when in (0.1, 0.2 - 1e-15, 0.2, 0.2 + 1e-15):
        found = np.array(step(0.1, 0.1, when)).ravel()
        s = (when - 0.1) / 0.1
        # one: y, y'; two: both y, both y'
        expected = [3.0 - 2.0 * s, -20.0, s, 2.0 + 3.0 * s, 10.0, 30.0]
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("kind", [TimeTable, TimeSpline])
def test_plain_python_looks_up_the_same_bits(kind: type[TimeTable | TimeSpline]) -> None:
    rng = np.random.default_rng(7)
    path = kind(table(rng, 40, 3), "table")
    function, namespace = look_up(path), dict[str, Any]()
    exec(program([function], path.look_ups), namespace)
    times = [row[0] for row in path.rows]
    for instant in [*times, *np.nextafter(times, -9), *rng.uniform(-3, 30, 500), np.inf, -np.inf]:
        result = [0.0] * 6
        namespace["look_up"]([float(instant)], result)
        assert result == np.array(function(instant)).ravel().tolist()


# --- splines and sines ------------------------------------------------------------------------


@SIZES
def test_a_spline_is_clamped_and_constant_outside(rows: int, columns: int) -> None:
    """Against SciPy within, and its first and last row outside."""
    rng = np.random.default_rng(rows)
    path = TimeSpline(table(rng, rows, columns), "table")
    data, function = np.array(path.rows), look_up(path)
    outside = [data[0, 0] - 1, data[0, 0], data[-1, 0], data[-1, 0] + 1]
    for instant, row in zip(outside, (0, 0, -1, -1), strict=True):
        found = np.array(function(instant)).ravel()
        np.testing.assert_allclose(found, [*data[row, 1:], *np.zeros(columns)], atol=1e-10)
    if rows == 1:
        return
    scipy = CubicSpline(data[:, 0], data[:, 1:], bc_type="clamped")
    for instant in rng.uniform(data[0, 0], data[-1, 0], 300):
        expected = np.concatenate([scipy(instant), scipy(instant, 1)])
        np.testing.assert_allclose(np.array(function(instant)).ravel(), expected, atol=1e-10)


def test_a_spline_and_its_rate_are_continuous_at_its_rows() -> None:
    path = TimeSpline(table(np.random.default_rng(3), 20, 2), "table")
    function = look_up(path)
    for instant, *_ in path.rows:
        near = [function(np.nextafter(instant, to)) for to in (-9, instant, 99)]
        for other in near[1:]:
            np.testing.assert_allclose(other, near[0], rtol=1e-9, atol=1e-9)


def test_a_sine_has_its_mean_amplitude_frequency_and_phase() -> None:
    sine = PoseSine(
        mean=(0.1, 0.0, 0.3),
        amplitude=(0.05, 0.02, 0.0),
        frequency=(0.5, 2.0, 1.0),
        phase=(0.0, 0.7, 0.0),
    )
    function = look_up(TimeSine(sine, "sine"))
    for instant in np.linspace(-1.0, 5.0, 50):
        a, b = np.pi * instant, 4 * np.pi * instant + 0.7
        expected = [0.1 + 0.05 * np.sin(a), 0.02 * np.sin(b), 0.3]
        expected += [0.05 * np.pi * np.cos(a), 0.02 * 4 * np.pi * np.cos(b), 0.0]
        np.testing.assert_allclose(np.array(function(instant)).ravel(), expected, atol=1e-14)
