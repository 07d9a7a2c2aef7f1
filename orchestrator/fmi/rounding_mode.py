"""How this thread rounds numbers, which an FMU's code may change for all that is computed after it.

The compiled loop does the same in C (process_state.c).
"""

from __future__ import annotations

import ctypes
import platform
import sys
from contextlib import suppress

_libm: ctypes.CDLL | None = None
if sys.platform != "win32":
    with suppress(OSError):
        _libm = ctypes.CDLL("libm.so.6" if sys.platform == "linux" else None)
_HAS_MXCSR = sys.platform == "linux" and platform.machine() == "x86_64"
_Environment = ctypes.c_uint32 * 64
"""At least as large as any fenv_t; on Linux with x86-64 the last of its 8 numbers is MXCSR."""
_now = _Environment()


def _control() -> int:
    """The rounding mode; on x86-64 with the masks of exceptions and how tiny numbers are taken."""
    assert _libm is not None
    if not _HAS_MXCSR:
        return int(_libm.fegetround())
    _libm.fegetenv(_now)
    return (_now[7] & 0xFFC0) << 16 | (_now[0] & 0xC00)


_before = _Environment()
_expected = 0
if _libm is not None:
    _libm.fegetenv(_before)
    _expected = _control()


def restored() -> bool:
    """Whether it was another than when this module was loaded: it is as it was then again."""
    if _libm is None or _control() == _expected:
        return False
    _libm.fesetenv(_before)
    return True
