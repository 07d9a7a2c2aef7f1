"""Inputs that vary within a step: polynomial holds on compiled FMUs that interpolate. What they
reach is in holds/test_order_of_accuracy.py and test_coupling.py."""

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.hold import HoldContext
from hapticlink.orchestrator.system import held_polynomials
from tests.orchestrator import coupled
from tests.orchestrator.coupled import scene_of
from tests.orchestrator.foreign_scenes import ISOLATED
from tests.orchestrator.holds.test_order_of_accuracy import error
from tests.orchestrator.native_mass import held, native
from tests.orchestrator.results.records import tables_of
from tests.shared_fixtures import status

Fmus = Mapping[str, Description]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("native")
    return {name: native(folder, name) for name in ("one", "two")}


@pytest.fixture(scope="module")
def constant(tmp_path_factory):
    """The same, of inputs that are constant within a step."""
    return held(tmp_path_factory.mktemp("constant"))


@pytest.mark.parametrize("name", sorted(n for n, hold in HOLDS.items() if hold.degree))
@settings(max_examples=30)
@given(data=st.data())
def test_what_an_fmu_is_told_is_the_hold(name, data):
    """Its Taylor polynomial, of order 1 to 3, is the hold everywhere within a step, and its mean
    that of the hold, for any samples and step sizes."""
    hold, size = HOLDS[name], 2
    made = hold(HoldContext(size, seconds=lambda ticks: 0.01 * ticks))
    stamp, period = 0, 8
    width = data.draw(st.integers(1, 8))
    entries = 2 * size if hold.needs == "derivative" else size
    for _ in range(data.draw(st.integers(1, 4))):
        stamp += period
        sample = data.draw(st.lists(st.floats(-5, 5), min_size=entries, max_size=entries))
        made.push(stamp, np.array(sample), stamp)
    tick = stamp + data.draw(st.integers(0, period - width))  # no bend of the hold in the step
    instants = np.linspace(0, width, hold.degree + 1)
    values = np.stack([made.value(tick, s) for s in instants])
    derivatives, mean = held_polynomials.split(values, 0.01 * width)
    inside = np.linspace(0, width, 7)
    found = [
        values[0]
        + sum(d * (0.01 * s) ** j / math.factorial(j) for j, d in enumerate(derivatives, 1))
        for s in inside
    ]
    expected = [made.value(tick, s) for s in inside]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    # Gauss-Legendre of two points is exact for cubics.
    points = width / 2 * (1 + np.array([-1, 1]) / np.sqrt(3))
    gauss = sum(made.value(tick, s) for s in points) / 2
    np.testing.assert_allclose(mean, gauss, rtol=0, atol=1e-9)


@pytest.mark.parametrize("hold", ["foh", "second-order", "delayed", "smooth"])
def test_substeps_change_nothing(fmus, hold):
    """Each substep goes on along the same polynomial."""
    found = []
    for substeps in (1, 3):
        made = coupled.masses(fmus, Fraction(1, 100), 60, hold, substeps=substeps)
        found.append(coupled.motion(coupled.rows(made)))
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-11)


def test_an_fmu_that_cannot_interpolate_takes_the_middle(fmus, constant):
    """`foh` on it is the lead; where only one of the two can, each gets what it can take."""
    assert error(constant, 100, "foh", 1) == pytest.approx(7.08e-3, rel=0.02)
    mixed = {"one": fmus["one"], "two": constant["two"]}
    made = coupled.masses(mixed, Fraction(1, 100), 10, "foh")
    assert {c.name: held_polynomials.order(made, c) for c in made.connections} == {
        "two.F -> one.F": 1,
        "one.x -> two.x1": 0,
        "one.v -> two.v1": 0,
    }


SETTINGS = (
    'coupling = "jacobi"\nholds = { "two.F" = "second-order", "one.x" = "foh", "one.v" = "zoh" }\n'
)


def test_a_run_and_a_plan_say_who_takes_what(fmus, tmp_path, capsys):
    options = ["substeps.two=2"]
    found = simulate(scene_of(fmus, SETTINGS), tmp_path / "out", options).results.run
    assert found["within_a_step"] == {
        "two.F -> one.F": "derivatives to order 2",
        "one.x -> two.x1": "derivatives to order 1, renewed in 2 substeps",
    }
    assert status("run", scene_of(fmus, SETTINGS), "--explain", "--set", options[0]) == 0
    told = capsys.readouterr().out
    assert "  evaluate two.F -> one.F order 2 width 1\n" in told
    assert "  evaluate one.x -> two.x1 ahead 1/2 order 1 width 1/2\n" in told
    assert "  set one derivatives True\n" in told


def test_a_run_says_where_an_fmu_cannot(constant, tmp_path):
    found = simulate(scene_of(constant, SETTINGS), tmp_path / "out", ["substeps.two=2"]).results.run
    assert found["within_a_step"] == {
        "two.F -> one.F": "constant, the hold at the middle (half-step lead)",
        "one.x -> two.x1": "constant in each of 2 substeps",
    }


def test_in_a_process_of_its_own_it_is_the_same(fmus, tmp_path):
    for name, own in (("here", ""), ("apart", ISOLATED)):
        ended = simulate(scene_of(fmus, SETTINGS, own), tmp_path / name)
        assert ended.outcome.fault is None
    assert tables_of(tmp_path / "here") == tables_of(tmp_path / "apart")


def test_derivatives_convert_like_values(fmus, tmp_path):
    """A force of minus F through a factor of -1, from a spring that pushes the other way."""
    turned = {"one": native(tmp_path, "one"), "two": fmus["two"]}
    (tmp_path / "two.fmu").write_bytes(native(tmp_path, "two", sign=-1.0).path.read_bytes())
    plain = simulate(scene_of(fmus, SETTINGS), tmp_path / "plain").results.haptics
    found = simulate(
        scene_of(turned, SETTINGS, force="factor = -1.0\n"), tmp_path / "out"
    ).results.haptics
    np.testing.assert_allclose(found["one.x"], plain["one.x"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["two.F"], -plain["two.F"], rtol=0, atol=1e-9)


def test_a_step_taken_again_in_halves_goes_on_along_the_polynomial(fmus, tmp_path):
    """`one` discards what is longer than an eighth of a step; exact as it is, nothing changes."""
    (tmp_path / "brittle").mkdir()
    brittle = native(tmp_path / "brittle", "one", brittle=1e-9, fine=0.01 / 8, failure=2)
    plain = simulate(scene_of(fmus, SETTINGS), tmp_path / "plain").results.haptics
    path = scene_of({"one": brittle}, SETTINGS)
    (path.parent / "two.fmu").write_bytes(fmus["two"].path.read_bytes())
    ended = simulate(path, tmp_path / "out", ["faults.discard=retry"])
    assert ended.outcome.fault is None
    assert ended.outcome.details.smaller_steps["one"] > 40
    for name in ("one.x", "one.v", "two.F"):
        np.testing.assert_allclose(ended.results.haptics[name], plain[name], rtol=0, atol=1e-10)
