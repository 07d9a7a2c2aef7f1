"""Start values of FMU variables: types, and integers that no double can represent."""

from __future__ import annotations

from hapticlink.orchestrator.fmi.variables import CONTINUOUS, Scalar

Given = bool | int | float | str
"""A start value as a scene gives it."""
_WORDS = {bool: "true or false", int: "a whole number", (int, float): "a number", str: "text"}
WIDE = ("Int64", "UInt64")
"""Types whose values may not be representable as a double."""
EXACT = 2**53
"""Every integer of at most this magnitude is a double."""


def fit_start_value(scalar: Scalar, given: Given) -> Given:
    """The value to set for a start value `given` by a scene: itself, or the number of an item of an
    enumeration that is given by its name.

    Raises ValueError, with the values that are possible, if it does not have the variable's type.
    """
    if scalar.items and isinstance(given, str):
        if given not in dict(scalar.items):
            names = ", ".join(name for name, _ in scalar.items)
            raise ValueError(f"{given!r}: {scalar.name} is one of {names}")
        return dict(scalar.items)[given]
    kind = _takes(scalar)
    if not isinstance(given, kind) or (isinstance(given, bool) and scalar.type != "Boolean"):
        remedy = "; connect a text to a String" if isinstance(given, str) else ""
        raise ValueError(f"{given!r}: {scalar.name} takes {_WORDS[kind]}{remedy}")
    if isinstance(given, str) and "\0" in given:
        raise ValueError(f"{given!r}: {scalar.name} would end at the \\0: texts of FMI do")
    if scalar.type == "Binary":
        try:
            bytes.fromhex(str(given))
        except ValueError:
            takes = "pairs of hexadecimal digits, as FMI 3.0 writes them"
            raise ValueError(f"{given!r}: {scalar.name} takes {takes}") from None
    return given


def _takes(scalar: Scalar) -> type | tuple[type, type]:
    """The Python types of the start values of a variable."""
    if scalar.type in CONTINUOUS:
        return (int, float)
    return {"Boolean": bool, "String": str, "Binary": str}.get(scalar.type, int)


Starts = tuple[tuple[Scalar, Given], ...]
"""Variables with their start values."""


def find_wide_integers(starts: Starts) -> dict[str, int]:
    """The 64-bit integers among `starts` that are larger than `EXACT`, by the variable's name."""
    return {
        s.name: v for s, v in starts if s.type in WIDE and isinstance(v, int) and abs(v) > EXACT
    }
