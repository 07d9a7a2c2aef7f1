"""Growth rates of the lifted map with early steps against those of runs, and how these are read."""

from dataclasses import replace

import numpy as np
import pytest

from studies.model_growth import FAR, Cell, agree, left_of, of_map, of_run
from studies.run_modes import fit_modes


def test_the_eigenvalues_of_a_linear_system_are_found_in_its_snapshots() -> None:
    """Two modes that decay nearly alike, one of which oscillates: windows show a mixture."""
    t, x = np.arange(80.0)[:, None], np.array([1.0, 0.5, -0.3])
    motion = 0.97**t * np.cos(0.4 * t) * x + 0.98**t * x[::-1]
    found = np.sort(np.abs(fit_modes(motion.reshape(20, -1))[0]))
    assert found == pytest.approx(np.array([0.97, 0.97, 0.98]) ** 4, abs=1e-9)


@pytest.mark.parametrize(
    "cell",
    [Cell("five-bar", "medium", 8, 100.0), Cell("four-bar", "firm", 16, 500.0, 0.5)],
    ids=str,
)
def test_a_run_grows_as_fast_as_the_map_tells(cell: Cell) -> None:
    told, P = of_map(cell)
    assert told > 0.1
    assert agree(told, of_run(cell, P))
    assert not agree(told, -told)


def test_larger_motions_decay_where_those_far_below_10_um_grow() -> None:
    """The map has `half-lead` in the place of `reaction`, and grows as that does."""
    cell = Cell("four-bar", "firm", 16, 500.0)
    assert of_map(cell)[0] > 0.1
    far = replace(cell, off=FAR)
    assert left_of(far, "reaction") < 100.0
    assert left_of(far, "half-lead") > 3000.0
