"""The attacks by hostile FMUs, folders, special files, plugins, calls of the API and scenes on both
loops, in short."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator

import pytest

from tests.attack import folders, hostile, loops, misuse, plugins, special_files
from tests.attack.cases import Made, bad, counted

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and reads /proc")


@pytest.mark.parametrize(
    ("attack", "number"),
    [
        (hostile.attack, 6),
        (folders.attack, 2),
        (special_files.attack, 11),
        (plugins.attack, 9),
        (misuse.attack, 18),
        (loops.attack, 3),
    ],
    ids=["hostile", "folders", "special files", "plugins", "misuse", "loops"],
)
def test_nothing_is_lost_crashes_hangs_or_is_believed(
    attack: Callable[[int, int], Iterator[Made]], number: int, capsys: pytest.CaptureFixture[str]
) -> None:
    counts = counted(attack(number, 7))
    assert not bad(counts), capsys.readouterr().err
    assert sum(counts.values(), Counter()).total() >= number
