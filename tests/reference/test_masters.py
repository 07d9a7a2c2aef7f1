"""Loops beside which `hapticlink bench master` measures take the steps that they say they take."""

from pathlib import Path

import pytest

from benchmarks import rings
from benchmarks.peers.masters import MASTERS, Ring, went_on


@pytest.mark.parametrize("master", ["C loop", "ctypes", "FMPy"])
def test_a_second_call_goes_on_where_the_first_ended(tmp_path: Path, master: str) -> None:
    folder = tmp_path / "ring"
    folder.mkdir()
    rings.make("native", 2, 3, folder)
    run = MASTERS[master](Ring(folder))
    assert run(3) >= 0
    assert run(2) >= 0


def test_a_refused_step_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="a step of 0 to 5 was refused"):
        went_on(lambda first, steps: 3)(5)
