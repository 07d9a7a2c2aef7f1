"""Energy of connections whose numbers are converted on the way, or stand apart on the board: the
sampled spring in closed form, whatever its units, factors and the order of its outputs."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.orchestrator.experiment import Experiment, simulate
from tests.orchestrator.foreign_fmus import entries, fmu_table, scene, slave, wire_table, with_units

STIFFNESS = np.array([300.0, 50.0])
"""N/m, along x[1] and x[2]."""


def path(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """The way that Moves goes (m)."""
    return np.stack([0.02 * np.sin(9 * t), 0.03 * (np.cos(7 * t) - 1)], axis=1)


def fmus(folder: Path, length: str = "m", force: str = "N", sign: int = -1) -> None:
    """Moves goes its way in `length` and takes efforts in `force`; Spring takes m and gives N. Of
    each, what is put out stands apart in the file, or not in order."""
    scale = {"m": 1.0, "mm": 1e3}[length]
    way = f"""values["x[1]"] = {scale} * .02 * sin(9 * end)
        values["x[2]"] = {scale} * .03 * (cos(7 * end) - 1)"""
    x = {"x[1]": 0.0, "z": 7.0, "x[2]": 0.0}
    moves = slave(folder, "Moves", ("input", entries("f", 2)), ("output", x), body=way)
    with_units(moves, **entries("f", 2, force), **entries("x", 2, length))
    pull = "\n        ".join(
        f"values['F[{i}]'] = {sign * k} * values['d[{i}]']" for i, k in enumerate(STIFFNESS, 1)
    )
    f = {"F[2]": 0.0, "e": 7.0, "F[1]": 0.0}
    spring = slave(folder, "Spring", ("input", entries("d", 2)), ("output", f), body=pull)
    with_units(spring, **entries("d", 2, "m"), **entries("F", 2, "N"))


FMUS = (
    fmu_table("moves", "Moves")
    + fmu_table("spring", "Spring", 'timing = "sampled"\n')
    + '[[power]]\neffort = "moves.f"\ndisplacement = "moves.x"\n'
)
BACK = wire_table("moves.x[{0}]", "spring.d[{0}]")
PULL = wire_table("spring.F[{0}]", "moves.f[{0}]")


def run(folder: Path, how: str = "", head: str = "") -> Experiment:
    text = head + FMUS + "".join(BACK.format(i) + PULL.format(i) + how for i in (1, 2))
    experiment = simulate(str(scene(folder, text)), folder / "out")
    assert experiment.outcome.fault is None
    return experiment


def energies(experiment: Experiment) -> dict[str, NDArray[np.float64]]:
    """made, held and ideal (J) of both entries."""
    found = experiment.results.run["energies_within_a_rate"]
    rows = [found[f"spring.F[{i}] -> moves.f[{i}]"] for i in (1, 2)]
    return {key: np.array([row[key] for row in rows]) for key in ("generated", "held", "ideal")}


@pytest.mark.parametrize("length", ["m", "mm"])
@pytest.mark.parametrize("force", ["N", "kN"])
@pytest.mark.parametrize(("factor", "offset"), [(1.0, 0.0), (-2.5, 0.0), (0.5, 0.004)])
def test_a_sampled_spring_through_conversions(tmp_path, length, force, factor, offset):
    fmus(tmp_path, length, force)
    found = energies(run(tmp_path, f"factor = {factor}\noffset = {offset}\n"))
    stiffness, push = factor * STIFFNESS, offset * {"N": 1.0, "kN": 1e3}[force]
    x = path(np.arange(33) / 64)
    gone = x[-1] - x[0]
    made = 0.5 * stiffness * np.sum(np.diff(x, axis=0) ** 2, axis=0)
    ideal = -0.5 * stiffness * (x[-1] ** 2 - x[0] ** 2) + push * gone
    np.testing.assert_allclose(found["generated"], made, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found["ideal"], ideal, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found["held"], made + ideal, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("hold", ["passive", "nepce"])
def test_holds_that_keep_account_do_so_in_the_units_of_the_target(tmp_path, hold):
    head = f'holds."spring.F[1]" = "{hold}"\nholds."spring.F[2]" = "{hold}"\n'
    fmus(tmp_path)
    plain = energies(run(tmp_path, head=head))
    fmus(tmp_path, "mm", "kN", sign=1)
    turned = energies(run(tmp_path, "factor = -1.0\n", head))
    for key, value in plain.items():
        np.testing.assert_allclose(turned[key], value, rtol=1e-9)
    fmus(tmp_path)
    assert (plain["generated"] < 0.2 * energies(run(tmp_path))["generated"]).all()


def test_a_vector_whose_entries_stand_apart_is_booked_as_one(tmp_path):
    fmus(tmp_path, "mm", "kN")
    one_by_one = energies(run(tmp_path))
    text = FMUS + (BACK + PULL).replace("[{0}]", "")
    experiment = simulate(str(scene(tmp_path, text)), tmp_path / "whole")
    found = experiment.results.run["energies_within_a_rate"]["spring.F -> moves.f"]
    for key, values in one_by_one.items():
        assert found[key] == pytest.approx(values.sum(), rel=1e-12)
