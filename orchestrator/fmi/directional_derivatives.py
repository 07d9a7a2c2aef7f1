"""Directional derivatives of one FMU, as a matrix."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.status import succeeded
from hapticlink.orchestrator.fmi.variables import Scalar

Matrix = NDArray[np.float64]


def derivatives(
    slave: Any, description: Description, outputs: Sequence[Scalar], inputs: Sequence[Scalar]
) -> Matrix | None:
    """The Jacobian (outputs, inputs), by one call per input; None if a call fails.

    fmi2GetDirectionalDerivative, FMI 2.0.5 section 2.1.9; in FMI 3.0, section 2.2.11, arrays are
    derived whole, in the order of their entries.
    """
    call = slave.dll[f"fmi{description.fmi}GetDirectionalDerivative"]
    unknowns = _whole(description, outputs)
    column, rows = np.zeros(len(unknowns)), [unknowns.index(_key(s)) for s in outputs]
    columns = []
    for scalar in inputs:
        knowns = _whole(description, [scalar])
        seed = np.array([float(k == _key(scalar)) for k in knowns])
        arguments: list[Any] = [ctypes.c_void_p(slave.component)]
        for keys in (unknowns, knowns):
            references = [reference for reference, entry in keys if entry == 0]
            arguments.append((ctypes.c_uint * len(references))(*references))
            arguments.append(ctypes.c_size_t(len(references)))
        for values in (seed, column):
            arguments.append(ctypes.c_void_p(values.ctypes.data))
            if description.fmi == "3":
                arguments.append(ctypes.c_size_t(len(values)))
        if not succeeded(call(*arguments)):
            return None
        columns.append(column[rows])
    return np.stack(columns, axis=1)


def _key(scalar: Scalar) -> tuple[int, int]:
    return scalar.reference, scalar.entry


def _whole(description: Description, scalars: Sequence[Scalar]) -> list[tuple[int, int]]:
    """(reference, entry) of all entries of the variables that `scalars` belong to."""
    references = dict.fromkeys(s.reference for s in scalars)
    types = {s.type for s in scalars}
    every = dict.fromkeys(_key(s) for s in description.scalars if s.type in types)
    return [key for reference in references for key in every if key[0] == reference]
