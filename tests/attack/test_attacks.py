"""The attacks on commands, files and the API, in short."""

from __future__ import annotations

import sys
from functools import partial

import pytest

from tests.attack import archives, signals
from tests.attack.__main__ import ATTACKS
from tests.attack.cases import bad, counted, total

CASES: dict[str, tuple[int, set[str]]] = {
    "archives": (2 * len(archives.KINDS), set()),
    "hostile": (4, set()),
    "folders": (1, set()),
    "special_files": (11, set()),
    "plugins": (9, set()),
    "misuse": (18, set()),
    "loops": (3, set()),
    "scenes": (20, {"refused", "done"}),
    "options": (30, {"refused", "done"}),
    "ssps": (5, {"refused", "done"}),
    "signals": (6, {"told"}),
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
    (number, outcomes), attack = CASES[name], ATTACKS[name][0]
    if name == "signals":
        attack = partial(signals.attack, scene="pendulum", duration=0.1)
    counts = counted(attack(number, 7))
    assert not bad(counts), capsys.readouterr().err
    ended = total(counts)
    assert ended.total() == number or (name in MORE and ended.total() > number)
    assert outcomes <= {*ended}
    if name == "archives":
        assert {kind: n.total() for kind, n in counts.items()} == dict.fromkeys(archives.KINDS, 2)
