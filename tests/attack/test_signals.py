"""The attack by signals, in short."""

import sys
from collections import Counter

import pytest

from tests.attack.cases import bad, counted
from tests.attack.signals import attack


@pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")
def test_no_run_is_lost_crashes_or_hangs_by_a_signal(capsys: pytest.CaptureFixture[str]) -> None:
    counts = counted(attack(6, seed=7, duration=0.1))
    assert not bad(counts), capsys.readouterr().err
    found = sum(counts.values(), Counter())
    assert found.total() == 6
    assert found["told"]
