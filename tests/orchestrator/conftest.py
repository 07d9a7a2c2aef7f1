"""Settings of the tests of co-simulation."""

from contextlib import nullcontext

import pytest

from hapticlink.orchestrator.host import crash_monitor


@pytest.fixture(autouse=True)
def crash_monitor_of_runs(monkeypatch):
    """Runs in the process of the tests start no watchdog, which acts only where that process
    crashes. The tests of run/test_faults.py and run/test_interrupt.py, which have it, replace
    this fixture."""
    monkeypatch.setattr(crash_monitor, "watch_for_crash", lambda *_: nullcontext())


@pytest.fixture(scope="module", autouse=True)
def _fmus_stay_unpacked(fmus_unpacked_once):
    """From one run to the next."""
