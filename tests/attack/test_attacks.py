"""The attacks on commands, files and the API, in short."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from tests.attack import (
    archives,
    folders,
    hostile,
    loops,
    misuse,
    options,
    plugins,
    scenes,
    signals,
    special_files,
    ssps,
)
from tests.attack.cases import Made, bad, counted, total

Attack = Callable[[int, int], Iterator[Made]]
CASES: dict[str, tuple[Attack, int, set[str]]] = {
    "archives": (archives.attack, 2 * len(archives.KINDS), set()),
    "hostile": (hostile.attack, 4, set()),
    "folders": (folders.attack, 1, set()),
    "special files": (special_files.attack, 11, set()),
    "plugins": (plugins.attack, 9, set()),
    "misuse": (misuse.attack, 18, set()),
    "loops": (loops.attack, 3, set()),
    "scenes": (scenes.attack, 20, {"refused", "done"}),
    "options": (options.attack, 30, {"refused", "done"}),
    "ssps": (ssps.attack, 5, {"refused", "done"}),
    "signals": (partial(signals.attack, scene="pendulum", duration=0.1), 6, {"told"}),
}
"""How many cases of each attack, and outcomes that some of them have."""
FORKING = {"scenes", "options", "ssps"}
"""Attacks that need no more than a fork; the others read /proc."""
MORE = {"loops"}
"""Attacks that judge a scene once more, under sanitizers."""


@pytest.mark.parametrize("name", CASES)
def test_nothing_is_lost_crashes_hangs_or_is_believed(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if sys.platform == "win32" or (sys.platform != "linux" and name not in FORKING):
        pytest.skip("forks, and reads /proc")
    attack, number, outcomes = CASES[name]
    counts = counted(attack(number, 7))
    assert not bad(counts), capsys.readouterr().err
    ended = total(counts)
    assert ended.total() == number or (name in MORE and ended.total() > number)
    assert outcomes <= {*ended}
    if name == "archives":
        assert {kind: n.total() for kind, n in counts.items()} == dict.fromkeys(archives.KINDS, 2)
