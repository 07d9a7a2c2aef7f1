"""A scene's own tables beside those of the components, as frozen records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

from hapticlink.components.blocks import BLOCKS
from hapticlink.components.registry import Registry
from hapticlink.components.specs.quantities import Elapsed, Quantity, Seed
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.rates import AnyRate, Seconds

SCHEMES: Registry[Any] = Registry("scheme", {})
"""Coupling schemes. `plan.schemes` puts them here: what they order is of rooms above this one."""
HoldName = Annotated[str, HOLDS.names()]

OWN = "the variable's own"
"""The unit of what belongs to an FMU that is not the project's."""
Value = (
    bool
    | Annotated[int, Quantity(OWN)]
    | Annotated[float, Quantity(OWN)]
    | str
    | tuple[bool | Annotated[int | float, Quantity(OWN)], ...]
)


@dataclass(frozen=True, kw_only=True)
class ForeignFmu:
    """An FMU of FMI 2.0 or 3.0 co-simulation, or a block that is built into one."""

    name: str
    """By which connections and results speak of it: letters, digits and _."""
    path: str | None = None
    """Its file, from the folder of the scene's."""
    block: Annotated[str, BLOCKS.names()] | None = None
    """In place of a file, the block that is built ([extending](extending.md#a-block))."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Those of the block, by name."""
    rate: Literal["haptics", "graphics"] | AnyRate = "haptics"
    """Its communication rate: that of the scene, or one of its own, as graphics.rate."""
    timing: Literal["sampled", "continuous"] | None = None
    """sampled: doStep(t, h) puts out y(t) of the inputs of t; continuous: y(t + h). What the FMU
    declares where left out, "continuous" where it does not."""
    start: Mapping[str, Value] = field(default_factory=dict)
    """Values of inputs and parameters by name; a list for a whole vector."""
    derivatives: Mapping[str, str] = field(default_factory=dict)
    """By an output, the output that is its derivative, where the FMU does not declare it."""
    isolate: bool = False
    """Runs it in a process of its own."""


@dataclass(frozen=True, kw_only=True)
class Wire:
    """A connection of a scalar or a whole vector, between any FMUs of the scene. One to an input of
    a block takes the place of the loop's own."""

    from_: Annotated[str, Field(alias="from")]
    """The output, `fmu.variable`."""
    to: str
    """The input, `fmu.variable`."""
    hold: HoldName | None = None
    """Its hold between rates; the scene's where left out."""
    factor: Annotated[float, Quantity("1")] = 1.0
    """The input gets factor y + offset, after the conversion of units; not 0."""
    offset: Annotated[float, Quantity(OWN)] = 0.0
    """See `factor`."""
    convert: bool = True
    """Converts between the units of the two ends."""


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """What `coupling = "iterated"` repeats until connected plants of a rate agree."""

    method: Literal["aitken", "newton"] = "aitken"
    """Fixed point with Aitken's relaxation, or Newton."""
    tolerance: Annotated[float, Quantity("1", gt=0, lt=1)] = 1e-9
    """Outputs y agree where they differ by at most tolerance (1 + |y|)."""
    most: Annotated[int, Quantity("1", ge=1, le=10000)] = 50
    """Most repetitions of a step; those that make Newton's Jacobian are not counted."""
    interpolation: Annotated[str, HOLDS.names(lambda hold: hold.interpolates)] = "foh"
    """Hold on connections between plants of a rate: zoh, their value at the end of the step; foh,
    linear from its start; second-order; hermite, which needs derivatives (foh without)."""
    unconverged: Literal["stop", "accept"] = "stop"
    """Ends the run, or goes on with what there is."""


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Latency and loss of each sample of a connection, drawn by numpy's PCG64. Connections of one
    seed lose and delay the same samples, as one packet would."""

    min: Elapsed = 0.0
    """Least latency."""
    max: Elapsed | None = None
    """Largest latency; `min` where left out, a constant latency."""
    loss: Annotated[float, Quantity("1", ge=0, le=1)] = 0.0
    """Probability that a sample is lost."""
    seed: Seed = 0
    """Seed."""


@dataclass(frozen=True, kw_only=True)
class StepControl:
    """Steps chosen for accuracy."""

    method: Literal["doubling", "ecco"]
    """doubling: a step against two of half its size; ecco: the residual energy of a step."""
    tolerance: Annotated[float, Quantity("1", gt=0)]
    """doubling: error per second of an output y over its nominal (1 where it has none) + |y|; ecco:
    residual energy over `energy`."""
    min: Seconds
    """Shortest step, accepted whatever its error."""
    max: Seconds | None = None
    """Longest step; a period of the rate where left out."""
    energy: Annotated[float, Quantity("J", gt=0)] | None = None
    """The energy that matters in the scene, which ecco needs."""


@dataclass(frozen=True, kw_only=True)
class PowerPort:
    """The power into a plant is sign * effort . d(displacement)/dt."""

    effort: str
    """An input, `fmu.port` or an entry of it (N and N.m; other units count by their factors)."""
    displacement: str
    """The output of the same FMU that the effort works on (m and rad)."""
    sign: Annotated[float, Quantity("1", ge=-1, le=1)] = 1.0
    """-1 where the effort counts against the displacement."""

    @property
    def fmu(self) -> str:
        return self.effort.partition(".")[0]


@dataclass(frozen=True, kw_only=True)
class SetSpring:
    """F = stiffness (set_position - position) + damping (set_velocity - velocity), entry by entry,
    of an FMU whose far end the scene sets."""

    set_position: str
    """The input that sets the far end, `fmu.port`."""
    position: str
    """The near end: an input of that FMU at its own rate, or an output of it."""
    stiffness: tuple[Annotated[float, Quantity(OWN, ge=0)], ...]
    """Stiffness, entry by entry."""
    damping: tuple[Annotated[float, Quantity(OWN, ge=0)], ...] = ()
    """Damping, entry by entry; 0 where left out."""
    set_velocity: str = ""
    """The input that sets the far end's velocity; 0 where left out."""

    @property
    def ports(self) -> tuple[str, ...]:
        """What the far end sets."""
        return tuple(p for p in (self.set_position, self.set_velocity) if p)
