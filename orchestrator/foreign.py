"""[[fmu]] and [[connection]]: anyone's FMUs in a scene, as frozen records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from hapticlink.orchestrator.rates import AnyRate

Value = bool | int | float | str | tuple[bool | int | float, ...]


@dataclass(frozen=True, kw_only=True)
class ForeignFmu:
    """An FMU of FMI 2.0 or 3.0 co-simulation.

    path: relative to the scene file. rate: "haptics", "graphics", or one of its own,
    as graphics.rate.
    timing: None takes what the FMU declares, and "continuous" where it doesn't; "sampled" is a
    block whose doStep(t, h) puts out y(t) of the inputs of t. start: values of inputs and
    parameters by name; a list for a whole vector. isolate: in a process of its own.
    """

    name: str
    path: str
    rate: AnyRate = "haptics"
    timing: Literal["sampled", "continuous"] | None = None
    start: Mapping[str, Value] = field(default_factory=dict)
    isolate: bool = False


@dataclass(frozen=True, kw_only=True)
class Wire:
    """`from = "a.y"` to `to = "b.u"`: a scalar or a whole vector, of any FMU of the scene.

    hold: None takes the scene's. Units convert by themselves where `convert`; the target gets
    factor y + offset of that. A wire to an input of a block takes the place of the loop's own.
    """

    from_: Annotated[str, Field(alias="from")]
    to: str
    hold: str | None = None
    factor: float = 1.0
    offset: float = 0.0
    convert: bool = True
