"""Runs in a loop, in one process: what a run leaves behind does not add up."""

from __future__ import annotations

import gc
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.fmus.build_fmu import build
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.process_cache import describe_once
from tests.orchestrator.coupled import gain

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
        hl.run("closed-loop-ideal", {"duration": 0.02})

    for _ in range(3):
        run()
    gc.collect()
    before = maps(), resident()
    for _ in range(12):
        run()
    gc.collect()
    assert maps() - before[0] < 12
    assert resident() - before[1] < 6 << 20


def test_states_that_are_saved_over_are_freed(tmp_path: Path) -> None:
    """Of a Python FMU: 0.6 kB each of 256 would be kept."""
    description = describe_once(build(gain("gain", 2.0, 0.0), tmp_path))

    with InProcess("gain", description, np.zeros(2)) as instance:
        instance.enter_initialization(0.0, 1.0)
        instance.exit_initialization()
        instance.save()
        tracemalloc.start()
        try:
            for _ in range(256):
                instance.save()
            assert tracemalloc.get_traced_memory()[0] < 60_000
        finally:
            tracemalloc.stop()


def test_fmus_of_one_library_work_beside_each_other(tmp_path: Path) -> None:
    """Two controllers and a mechanism of Python share one library: same bytes as isolated."""
    ours = hl.run("closed-loop-ideal", {"duration": 0.1}, out=tmp_path / "a", figures=False)
    apart = {"duration": 0.1, "isolate": True}
    theirs = hl.run("closed-loop-ideal", apart, out=tmp_path / "b", figures=False)
    assert ours.fault is theirs.fault is None
    for table in ("haptics.csv", "graphics.csv"):
        assert (tmp_path / "a" / table).read_bytes() == (tmp_path / "b" / table).read_bytes()
