"""Rows of a run in memory."""

import gc
import weakref

import numpy as np
import pytest

from hapticlink.orchestrator.results.run_results import RunResults, TableRows


def run() -> RunResults:
    """Results with a row."""
    results = RunResults()
    rows = TableRows({"a.x[1]": 0, "a.x[2]": 1}, np.array([1.0, 2.0]))
    results.recorder("haptics", rows).row(0.5)
    return results


def test_rows_are_freed_with_the_results_and_not_when_cycles_are_searched() -> None:
    gc.disable()
    try:
        results = run()
        known = weakref.ref(results)
        del results
        assert known() is None
    finally:
        gc.enable()


def test_columns_that_have_been_read_are_kept_and_nobody_writes_them() -> None:
    table = run().tables()["haptics"]
    assert table["a.x"].base is table["a.x"].base
    assert table["a.x"].tolist() == [[1.0, 2.0]]
    for name in ("time", "a.x", "a.x[2]"):
        with pytest.raises(ValueError, match="read-only"):
            table[name][0] = 3.0
