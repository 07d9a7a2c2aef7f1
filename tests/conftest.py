"""Settings of all tests."""

import gc
import os
import signal
from pathlib import Path

import pytest
import pythonfmu  # noqa: F401
from hypothesis import settings

SLOW = Path(__file__).with_name("slow_tests.txt")
"""The slowest ninth of the tests, which takes more than half of the time: files, tests and cases
that need about a second of a processor or more. `pytest -m ""` runs them."""

# The same draws every time: a test that fails here fails everywhere.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("repeatable")

# Matrices here have at most some dozen rows: threads of BLAS would only wait for each other, in
# this process and in those that tests start. Read when NumPy is imported, which comes after.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Hundreds of processes import the package, and each worker all tests: they share what is compiled.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

gc.disable()  # until all tests are imported, which leave no garbage

# A shell that starts pytest in the background has it ignore Ctrl-C, which processes of tests would
# inherit.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

COLLECTED = pytest.StashKey[set[str]]()
"""Files, tests and cases that were collected."""
WAITING = ("tests/visualization", "tests/docs/test_examples", "tests/orchestrator/network")
"""Tests that wait for a page, a command or a clock come first: others run meanwhile."""


def pytest_xdist_auto_num_workers() -> int:
    """Twice as many workers as there are processors: for half of their time tests wait, for other
    processes, a browser or a deadline."""
    return 2 * (os.cpu_count() or 1)


@pytest.hookimpl(tryfirst=True)  # before tests are selected by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    slow, collected = set(SLOW.read_text().splitlines()), set[str]()
    for item in items:
        name = item.nodeid.removeprefix("tests/")
        names = {name, name.partition("[")[0], name.partition("::")[0]}
        collected |= names
        if slow & names:
            item.add_marker("slow")
    if items:
        items[0].config.stash[COLLECTED] = collected
    items.sort(key=lambda item: not item.nodeid.startswith(WAITING))


def pytest_collection_finish() -> None:
    gc.freeze()  # modules and tests stay: no collection in a test looks through them
    gc.enable()


# pythonfmu is imported above from where it is installed: after a test in which FMPy runs a Python
# FMU, it would be the copy of that FMU, whose folder is gone, and runs in this process could not
# tell that theirs is the same.

# After the settings above, which are read when NumPy is imported.
from tests.shared_fixtures import (  # noqa: E402, F401
    bar,
    compiled_once,
    compiler_of_its_own,
    emptied_temporary_folder,
    fmus_unpacked_once,
    keeping,
    own_temporary_folder,
    shared_folder,
    stamped,
)
