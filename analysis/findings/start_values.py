"""Where the mechanism of a system starts."""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.base.signal_names import MECHANISM
from hapticlink.orchestrator.fmi.in_process import in_process
from hapticlink.orchestrator.system.system import System


def mechanism_outputs(system: System) -> dict[str, float]:
    """Start values of the mechanism's outputs, as its FMU assembles it in initialisation mode; {}
    without a mechanism, and with another FMU in its place, which is not run."""
    fmu = system.fmu.get(MECHANISM)
    if fmu is None or fmu.description.block != MECHANISM:
        return {}
    outputs = np.zeros(len(fmu.description.outputs))
    fmu_instance = in_process(fmu.description)(MECHANISM, fmu.description, outputs, fmu.starts)
    with fmu_instance as instance:
        instance.enter_initialization(0.0, 1.0)
        instance.read()
    return dict(zip((s.name for s in fmu.description.outputs), outputs.tolist(), strict=True))


def coordinates(values: dict[str, float]) -> list[float]:
    """The joint coordinates q[1], q[2], ... among named values."""
    return [float(value) for name, value in values.items() if name.startswith("q[")]
