"""Directional derivatives of one FMU, as a matrix."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException

from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.variables import Scalar


def derivatives(
    slave: Any, description: Description, outputs: Sequence[Scalar], inputs: Sequence[Scalar]
) -> Matrix | None:
    """The Jacobian (outputs, inputs), by one call per input; None if a call fails.

    fmi2GetDirectionalDerivative, FMI 2.0.5 section 2.1.9; in FMI 3.0, section 2.2.11, arrays are
    derived whole, in the order of their entries.
    """
    unknowns = _whole(description, outputs)
    rows = [unknowns.index(_key(s)) for s in outputs]
    sizes = (len(unknowns),) if description.fmi == "3" else ()
    columns = []
    for scalar in inputs:
        knowns = _whole(description, [scalar])
        seed = [float(k == _key(scalar)) for k in knowns]
        variables = [[r for r, entry in keys if entry == 0] for keys in (unknowns, knowns)]
        try:
            column = slave.getDirectionalDerivative(*variables, seed, *sizes)
        except FMICallException:
            return None
        columns.append(np.array(column)[rows])
    return np.stack(columns, axis=1)


def _key(scalar: Scalar) -> tuple[int, int]:
    return scalar.reference, scalar.entry


def _whole(description: Description, scalars: Sequence[Scalar]) -> list[tuple[int, int]]:
    """(reference, entry) of all entries of the variables that `scalars` belong to."""
    references = dict.fromkeys(s.reference for s in scalars)
    types = {s.type for s in scalars}
    every = dict.fromkeys(_key(s) for s in description.scalars if s.type in types)
    return [key for reference in references for key in every if key[0] == reference]
