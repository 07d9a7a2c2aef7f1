"""Start values: what a variable takes."""

from __future__ import annotations

from hapticlink.orchestrator.fmi.variables import Scalar

Given = bool | int | float | str
_WORDS = {bool: "true or false", int: "a whole number", (int, float): "a number", str: "text"}
WIDE = ("Int64", "UInt64")
EXACT = 2**53
"""Up to here every whole number is a double."""


def fitting(scalar: Scalar, given: Given) -> Given:
    """The value to set; an item of an enumeration may be given by its name. Raises ValueError,
    saying what fits."""
    if scalar.items and isinstance(given, str):
        if given not in dict(scalar.items):
            names = ", ".join(name for name, _ in scalar.items)
            raise ValueError(f"{given!r}: {scalar.name} is one of {names}")
        return dict(scalar.items)[given]
    kind = _takes(scalar)
    if not isinstance(given, kind) or (isinstance(given, bool) and scalar.type != "Boolean"):
        raise ValueError(f"{given!r}: {scalar.name} takes {_WORDS[kind]}")
    if scalar.type == "Binary":
        try:
            bytes.fromhex(str(given))
        except ValueError:
            takes = "pairs of hexadecimal digits, as FMI 3.0 writes them"
            raise ValueError(f"{given!r}: {scalar.name} takes {takes}") from None
    return given


def _takes(scalar: Scalar) -> type | tuple[type, type]:
    if scalar.type in ("Real", "Float64", "Float32"):
        return (int, float)
    return {"Boolean": bool, "String": str, "Binary": str}.get(scalar.type, int)


Starts = tuple[tuple[Scalar, bool | int | float | str], ...]


def wide(starts: Starts) -> dict[str, int]:
    """The whole numbers among `starts` that no double holds for sure, by the scalar's name."""
    return {
        s.name: v for s, v in starts if s.type in WIDE and isinstance(v, int) and abs(v) > EXACT
    }
