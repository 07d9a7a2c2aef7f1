"""[faults]: what a run does about an FMU that fails."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hapticlink.components.specs.quantities import Quantity


@dataclass(frozen=True, kw_only=True)
class Faults:
    """What a run does about an FMU that fails."""

    nan: Literal["stop", "hold"] = "stop"
    """An output that is not finite ends the run, or keeps its last finite value."""
    timeout: Annotated[float, Quantity("s", gt=0, le=86400)] = 60.0
    """How long an isolated FMU may take for one call."""
