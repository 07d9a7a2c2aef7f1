"""Numbers of a run as messages, tables and figures write them."""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.windows import last


def last_time(results: Results) -> float:
    """The time (s) of the last row of the first table that has any."""
    rows = (table["time"] for table in last(results).tables.values())
    return next((float(times[-1]) for times in rows if len(times)), 0.0)


def short(value: float) -> str:
    """A number with three significant digits, with an exponent only if very large or small."""
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}"
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")
