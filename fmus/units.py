"""SI units in FMI's notation ("N.m", "1/(kg.m2)") as exponents of base units.

FMI 2.0.5 section 2.2.2: a unit is a product of powers of kg, m, s, A, K, mol, cd, rad.
"""

from __future__ import annotations

import re
from collections import Counter

from hapticlink.components.ports import BASES
from hapticlink.fmus.errors import InvalidUnit

DERIVED: dict[str, dict[str, int]] = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}

_PRODUCT = r"[A-Za-z]+-?\d*(?:\.[A-Za-z]+-?\d*)*"
_UNIT = re.compile(rf"(?P<top>1|{_PRODUCT})(?:/(?:(?P<one>[A-Za-z]+\d*)|\((?P<low>{_PRODUCT})\)))?")


def base_unit(unit: str) -> dict[str, int]:
    """Exponents of the base units, without zeros; {} for "1".

    A unit may have one fraction bar, with a denominator of several factors in parentheses. Raises
    InvalidUnit with the part that is not understood.
    """
    match = _UNIT.fullmatch(unit)
    if match is None:
        raise InvalidUnit(f"unit {unit!r}: not of the form N.m, m/s2 or 1/(kg.m2)")
    exponents: Counter[str] = Counter()
    for product, side in ((match["top"], 1), (match["one"] or match["low"], -1)):
        for factor in (product or "1").split("."):
            if factor != "1":
                symbol, power = re.fullmatch(r"([A-Za-z]+)(-?\d*)", factor).groups()  # type: ignore[union-attr]
                if symbol not in BASES and symbol not in DERIVED:
                    known = ", ".join((*BASES, *DERIVED))
                    raise InvalidUnit(f"unit {unit!r}: {symbol!r} is none of {known}")
                for base, exponent in DERIVED.get(symbol, {symbol: 1}).items():
                    exponents[base] += side * exponent * int(power or 1)
    return {base: exponents[base] for base in BASES if exponents[base]}
