"""[faults]: what a run does about an FMU that fails."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Faults:
    """What a run does about an FMU that fails.

    nan: an output that is not finite ends the run, or keeps its last finite value. discard: an
    fmi2Discard ends the run, or the step is taken again in smaller ones where the FMU can do
    that. timeout (s): how long an isolated FMU may take for one call.
    """

    nan: Literal["stop", "hold"] = "stop"
    discard: Literal["stop", "retry"] = "stop"
    timeout: float = 60.0
