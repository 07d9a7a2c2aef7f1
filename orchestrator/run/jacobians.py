"""Jacobians of a chain of FMUs from their directional derivatives.

fmi2GetDirectionalDerivative gives dy = (dh/du) du of what the FMU computes in its mode, y = h(u)
(FMI 2.0.5 section 2.1.9, FMI 3.0 section 2.2.11): in initialisation the outputs by inputs of the
instant; in step mode h is the step, f_doStep of the table in section 4.1.2, so it is the outputs
at its end by inputs that were held over it. Not every FMU interprets the standard in this way, so
`solvers.Newton` falls back to finite differences where such a Jacobian does not help.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.system.system import Connection


@dataclass(frozen=True)
class PartialDerivatives:
    """Partial derivatives of one FMU: of the outputs at `rows` of the signal vector with respect to
    the inputs whose sources are at `columns`."""

    instance: Instance
    outputs: tuple[Scalar, ...]
    rows: tuple[int, ...]
    inputs: tuple[Scalar, ...]
    columns: tuple[int, ...]

    def of(self, tangent: Matrix) -> Matrix | None:
        """The derivatives (rows, n) of the outputs for derivatives `tangent` (signals, n) of all
        signals; None if the FMU does not give them."""
        slopes = self.instance.jacobian(self.outputs, self.inputs)
        if slopes is None:
            return None
        factors = np.array([s.conversion.factor for s in self.inputs])
        through: Matrix = slopes @ (factors[:, None] * tangent[list(self.columns)])
        return through


def find_derivatives(
    fmus: LoadedFmus, connections: Sequence[Connection], places: Sequence[int]
) -> list[PartialDerivatives] | None:
    """Per FMU on the loop, the partial derivatives of the outputs at `places` with respect to the
    connected inputs, in the system's order; None where an FMU gives none."""
    found = []
    signals = fmus.signals
    for fmu in fmus.system.fmus:
        incoming = [c for c in connections if c.target == fmu.name]
        span, outputs = signals.fmu(fmu.name), fmu.description.outputs
        rows = tuple(p for p in places if span.start <= p < span.stop)
        if not incoming or not rows:
            continue
        partial = PartialDerivatives(
            fmus.instances[fmu.name],
            tuple(outputs[p - span.start] for p in rows),
            rows,
            tuple(s for c in incoming for s in c.inputs),
            tuple(p for c in incoming for p in signals.places(c)),
        )
        if not fmu.description.gives_directional_derivatives:
            return None
        if any(s.type not in ("Real", "Float64") for s in (*partial.outputs, *partial.inputs)):
            return None
        found.append(partial)
    return found


def jacobian_of_residual(
    every: Sequence[PartialDerivatives], tangent: Matrix, places: Sequence[int]
) -> Matrix | None:
    """The Jacobian of g(w) - w for the outputs g at `places`, where `tangent` (signals, places) are
    the derivatives of all signals by w; None where an FMU gives none of its own."""
    slopes = np.zeros((len(tangent), len(places)))
    for partial in every:
        through = partial.of(tangent)
        if through is None:
            return None
        slopes[list(partial.rows)] = through
    jacobian: Matrix = slopes[list(places)] - np.eye(len(places))
    return jacobian
