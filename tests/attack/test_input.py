"""The attacks by scenes, options and SSPs, in short."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator

import pytest

from tests.attack import options, scenes, ssps
from tests.attack.cases import Made, bad, counted

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")


@pytest.mark.parametrize(
    ("attack", "number"),
    [(scenes.attack, 20), (options.attack, 30), (ssps.attack, 5)],
    ids=["scenes", "options", "ssps"],
)
def test_nothing_is_lost_crashes_or_hangs(
    attack: Callable[[int, int], Iterator[Made]], number: int, capsys: pytest.CaptureFixture[str]
) -> None:
    counts = counted(attack(number, 7))
    assert not bad(counts), capsys.readouterr().err
    found = sum(counts.values(), Counter())
    assert found.total() == number
    assert found["refused"]
    assert found["done"]
