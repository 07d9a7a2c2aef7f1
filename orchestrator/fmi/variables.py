"""The scalars of an FMU: variables of FMI 2.0, entries of arrays of FMI 3.0."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any
from xml.etree import ElementTree

from hapticlink.orchestrator.fmi.units import SAME, Linear

TYPES = (
    "Real", "Integer",
    "Float64", "Float32", "Int64", "Int32", "Int16", "Int8", "UInt64", "UInt32", "UInt16", "UInt8",
    "Boolean", "Clock", "String", "Binary",
)  # fmt: skip
"""The FMI types, by the name in their get and set functions: FMI 2.0's two, FMI 3.0's ten, Boolean
of both, Clock, whose number is how often it has been active, and those that are no numbers."""
CONTINUOUS = ("Real", "Float64", "Float32")
"""Those of floating point."""
WRITTEN = ("String", "Binary")
"""The FMI types that are no numbers: signals have the number of the text (`texts`)."""
_CALLED = {("2", "Enumeration"): "Integer", ("3", "Enumeration"): "Int64"}
_DERIVATIVE = re.compile(r"der\((.+)\)")
_ENTRY = re.compile(r"\[[\d, ]+\]$")


@dataclass(frozen=True)
class Scalar:
    """One number of an FMU: a variable of FMI 2.0, an entry of an FMI 3.0 array."""

    name: str
    reference: int
    type: str
    causality: str
    unit: str | None
    variability: str = "continuous"
    start: float = 0.0
    relative: bool = False
    """Whether it is a difference, to which the offset of a unit does not apply."""
    entry: int = 0
    """Its index among the entries of its array, row by row."""
    conversion: Linear = SAME
    """Applied to values of a connection to an input; to an output's value where it is read, of an
    FMU in the place of a block with other units."""
    nominal: float = 1.0
    """Nominal value (FMI 2.0.5 section 2.2.7)."""
    bound: float | None = None
    """The magnitude beyond which a block of this project is outside of its model."""
    initial: str | None = None
    items: tuple[tuple[str, int], ...] = ()
    """Of an enumeration: name and value of each."""
    clocks: frozenset[int] = frozenset()
    """References of the Clocks of which one has to be active when it is set or read."""
    recorded: bool = False
    """Whether it is read as the outputs are, and is none."""

    @cached_property
    def port(self) -> str:
        """`x` of `x[1]`: the vector or matrix that the scalar is an entry of."""
        return entry_of(self.name)[0]

    @cached_property
    def indices(self) -> tuple[int, ...]:
        """(2, 3) of `x[2,3]`, () of a scalar."""
        return entry_of(self.name)[1]

    @property
    def settable(self) -> bool:
        """Whether it may be set before the end of initialisation, or be the target of a
        connection."""
        return self.causality in ("input", "parameter") and self.variability != "constant"

    @property
    def structural(self) -> bool:
        """Whether it sets the size of arrays, in configuration mode (FMI 3.0 section 2.3.3)."""
        return self.causality == "structuralParameter"

    @property
    def startable(self) -> bool:
        """Whether it takes a start value: also a state for which the FMU declares `initial`
        (FMI 2.0.5 section 2.2.7, FMI 3.0 section 2.4.7)."""
        started = self.initial in ("exact", "approx") and self.variability != "constant"
        return self.settable or self.structural or started


def entry_of(name: str) -> tuple[str, tuple[int, ...]]:
    """`x` and (2, 3) of `x[2,3]`: the vector or matrix that a scalar is an entry of, and its
    indices; () for a scalar by itself."""
    match = _ENTRY.search(name)
    return _ENTRY.sub("", name), tuple(map(int, re.findall(r"\d+", match[0]))) if match else ()


def differences(tree: ElementTree.Element) -> set[str | None]:
    """Names of the variables with relativeQuantity, which FMPy 0.3.32 does not read."""
    return {
        variable.get("name")
        for variable in tree.iterfind("./ModelVariables/*")
        if any(e.get("relativeQuantity") == "true" for e in (variable, *variable))
    }


def numbers(
    variable: Any, fmi: str, relative: bool, bounded: bool = False, resized: bool = False
) -> Iterator[Scalar]:
    """The scalars of a variable; entries of an FMI 3.0 array row by row, with indices from 1.
    bounded: the run has to end if its `max` is exceeded. resized: structural parameters have been
    changed; start values are NaN if their number does not match the new size."""
    kind = _CALLED.get((fmi, variable.type), variable.type)
    if (
        kind not in TYPES
        or kind in WRITTEN
        or (kind == "Clock" and variable.intervalVariability != "triggered")
    ):
        return
    check_variable(variable)
    names = names_of(variable)
    starts = [_number(text) for text in (variable.start or "").split()] or [0.0]
    if len(starts) == 1:
        starts *= len(names)
    elif len(starts) != len(names) and resized:
        starts = [math.nan] * len(names)
    declared = variable.declaredType
    for i, (name, start) in enumerate(zip(names, starts, strict=True)):
        yield Scalar(
            name,
            variable.valueReference,
            kind,
            variable.causality or "local",
            variable.unit or (declared and declared.unit),
            variable.variability,
            start,
            relative or bool(declared and declared.relativeQuantity == "true"),
            i,
            nominal=_nominal(variable),
            bound=float(variable.max) if bounded and variable.max else None,
            initial=variable.initial,
            items=tuple((i.name, int(i.value)) for i in declared.items) if declared else (),
            clocks=frozenset(clock.valueReference for clock in variable.clocks or ()),
        )


MAX_NUMBERS = 10**6
"""Numbers of an FMU; the largest have some 10^5."""


def require_countable(model: Any) -> None:
    """Raises ValueError for arrays with more entries than memory could hold."""
    count = sum(math.prod(variable.shape or ()) for variable in model.modelVariables)
    if count > MAX_NUMBERS:
        raise ValueError(f"{count} numbers with all entries of its arrays; at most {MAX_NUMBERS}")


def derivatives(model: Any) -> dict[str, str]:
    """By name of an output, the name of its time derivative: by the attribute `derivative`, or
    der(y) if variable names are structured (FMI 2.0.5 sections 2.2.7 and 2.2.9)."""
    structured = model.variableNamingConvention == "structured"
    by_output: dict[str, str] = {}
    for variable in model.modelVariables:
        names = names_of(variable)
        if variable.derivative is not None:
            by_output |= dict(zip(names_of(variable.derivative), names, strict=False))
        elif structured and (y := _DERIVATIVE.fullmatch(variable.name)):
            by_output |= {y[1] + name.removeprefix(variable.name): name for name in names}
    return by_output


def indices(sizes: Iterable[int]) -> list[str]:
    """The indices of all entries of an array row by row, as "[1,1]", "[1,2]" ...; [""] of a
    scalar."""
    every = product(*(range(1, 1 + size) for size in sizes))
    return [f"[{','.join(map(str, entry))}]" if entry else "" for entry in every]


def names_of(variable: Any) -> list[str]:
    """The names of the scalars of a variable."""
    return [f"{variable.name}{entry}" for entry in indices(variable.shape or ())]


def _nominal(variable: Any) -> float:
    given = variable.nominal or (variable.declaredType and variable.declaredType.nominal)
    return abs(float(given or 1.0)) or 1.0


def check_variable(variable: Any) -> None:
    """Raises ValueError for a name with control characters, which the schemas of FMI 2.0 and 3.0
    exclude too, and for a value reference that is no unsigned number of 32 bits, which a call would
    cut to another variable's."""
    name, reference = variable.name, variable.valueReference
    if not name.isprintable():
        raise ValueError(f"variable {name!r}: a name has printable characters only")
    if not 0 <= reference < 2**32:
        raise ValueError(
            f"variable {name!r}: value reference {reference} is not from 0 to 2^32 - 1"
        )


def require_unique(names: Iterable[str]) -> None:
    """Raises ValueError for a name that two variables have (FMI 2.0.5 section 2.2.7, FMI 3.0
    section 2.4.7), entries of arrays included: both would be one column of the results."""
    name, count = next(iter(Counter(names).most_common(1)), ("", 0))
    if count > 1:
        raise ValueError(f"variable {name!r}: {count} variables have this name")


def texts(v: Any) -> Iterator[Scalar]:
    """The entries of a String or Binary."""
    check_variable(v)
    about = v.causality or "local", None, v.variability, math.nan if v.shape else 0.0
    for i, name in enumerate(names_of(v)):
        yield Scalar(name, v.valueReference, v.type, *about, entry=i, initial=v.initial)


def _number(text: str) -> float:
    return float(text == "true") if text in ("true", "false") else float(text)
