"""What a start that cannot be is told as, rather than by the first output that is not finite."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hapticlink.orchestrator.faults import FmuFault
from hapticlink.orchestrator.fmu import Instance

DEVICE = "haptic_device"


def require_finite(instances: Mapping[str, Instance]) -> None:
    """Raises FmuFault: of the device where its arms do not reach the handle's start pose (its
    angles are NaN there, and all that is computed from them), else of the first output that is not
    finite."""
    device = instances.get(DEVICE)
    if device is not None and not np.isfinite(device.outputs).all():
        names = (s.name for s in device.description.outputs)
        start = dict(zip(names, device.outputs.tolist(), strict=True))
        margin = start.get("workspace_margin", 0.0)
        if margin < 0:
            pose = ", ".join(f"{start.get(f'x_true[{i}]', np.nan):.4g}" for i in (1, 2, 3))
            raise FmuFault(
                DEVICE,
                f"the start pose (x m, y m, theta rad) = ({pose}) is outside the device's "
                f"workspace by {-margin:.3g} m (move linkage.operational_point or linkage.start, "
                "or change [device])",
                0.0,
            )
    for instance in instances.values():
        instance.require_finite()
