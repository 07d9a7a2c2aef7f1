"""Numbers as messages, tables and figures write them."""

from __future__ import annotations

import numpy as np


def short(value: float) -> str:
    """A number with three significant digits, with an exponent only if very large or small."""
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}"
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")
