"""Runs in a loop, in one process: what a run leaves behind does not add up."""

from __future__ import annotations

import gc
import sys
import tracemalloc
from pathlib import Path

import pytest

import hapticlink as hl

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
    pytest.mark.usefixtures("emptied_temporary_folder"),
]


def maps() -> int:
    """The memory maps of this process, of which the kernel allows 65,530."""
    return len(Path("/proc/self/maps").read_text(encoding="utf-8").splitlines())


def resident() -> int:
    """The memory of this process (bytes)."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * 4096


def test_runs_in_a_loop_stay_flat() -> None:
    """Python FMUs keep their libraries loaded; 12 runs that each loaded their own added 36 maps and
    1 MB a run."""

    def run() -> None:
        hl.run("closed-loop", {"duration": 0.02})

    for _ in range(3):
        run()
    gc.collect()
    before = maps(), resident()
    for _ in range(12):
        run()
    gc.collect()
    assert maps() - before[0] < 12
    assert resident() - before[1] < 6 << 20


def test_states_that_are_saved_over_are_freed() -> None:
    """One state before each of the 256 steps that may be repeated: 0.6 kB each would be kept."""

    def kept(duration: float) -> int:
        options = {"duration": duration, "faults.discard": "retry"}
        tracemalloc.start()
        try:
            made = hl.run("pendulum", options, progress=None)
            assert made.run["calls"]["virtual_mechanism"]["save"] >= duration * 512
            del made
            gc.collect()
            return tracemalloc.get_traced_memory()[0]
        finally:
            tracemalloc.stop()

    kept(0.01)
    assert kept(0.5) - kept(0.01) < 60_000


def test_fmus_of_one_library_work_beside_each_other(tmp_path: Path) -> None:
    """Two controllers and a mechanism of Python share one library: same bytes as isolated."""
    ours = hl.run("closed-loop", {"duration": 0.1}, out=tmp_path / "a", figures=False)
    apart = {"duration": 0.1, "isolate": True}
    theirs = hl.run("closed-loop", apart, out=tmp_path / "b", figures=False)
    assert ours.fault is theirs.fault is None
    for table in ("haptics.csv", "graphics.csv"):
        assert (tmp_path / "a" / table).read_bytes() == (tmp_path / "b" / table).read_bytes()
