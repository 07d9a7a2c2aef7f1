"""The empty loop that real time is measured beside."""

import pytest

from benchmarks.real_time import RATE, EmptyLoop


def test_it_has_each_tick_until_its_end() -> None:
    loop = EmptyLoop(0.1)
    loop.start()
    report = loop.report()
    assert report["ticks"] == pytest.approx(0.1 * RATE, abs=1)
    assert report["lateness"]["max"] > 0
