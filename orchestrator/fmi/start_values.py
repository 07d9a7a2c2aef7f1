"""Start values: what a variable takes."""

from __future__ import annotations

from hapticlink.orchestrator.fmi.variables import Scalar

Given = bool | int | float | str
_WORDS = {bool: "true or false", int: "a whole number", (int, float): "a number", str: "text"}


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
    return given


def _takes(scalar: Scalar) -> type | tuple[type, type]:
    if scalar.type in ("Real", "Float64", "Float32"):
        return (int, float)
    return {"Boolean": bool, "String": str}.get(scalar.type, int)


Starts = tuple[tuple[Scalar, bool | int | float | str], ...]
