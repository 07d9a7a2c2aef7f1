"""[[fmu]] and [[connection]]: anyone's FMUs in a scene, as frozen records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

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


Rate = int | float | str
"""Hz; a fraction of whole numbers may be written as text ("30000/1001")."""


Seconds = int | float | str
"""s, written as a rate is ("1/2048")."""


@dataclass(frozen=True, kw_only=True)
class VariableRate:
    """Periods drawn uniformly between 1/max and 1/min (Hz), in whole haptic ticks."""

    min: Rate
    max: Rate
    seed: int = 0


AnyRate = Rate | VariableRate | tuple[float, ...]
"""A tuple holds the times (s) at which steps end. A file may also give a recorded trace,
`{ trace = FILE }`, which becomes such times."""


INTERPOLATING = ("zoh", "foh", "second-order", "hermite")
"""Holds that interpolate once they have the sample at the end of the step."""


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """Settings of [iteration].

    method: fixed point with Aitken's relaxation, or Newton. tolerance: outputs y agree where they
    differ by at most tolerance (1 + |y|). most: steps taken again for one step (those that make
    Newton's Jacobian not counted). interpolation: the hold on connections between plants of a
    rate: "zoh" their value at the end, "foh" linear from the start, "second-order", or "hermite",
    which needs derivatives ("foh" stands where there are none). unconverged: ends the run, or
    goes on with what there is.
    """

    method: Literal["aitken", "newton"] = "aitken"
    tolerance: float = 1e-9
    most: int = 50
    interpolation: Literal["zoh", "foh", "second-order", "hermite"] = "foh"
    unconverged: Literal["stop", "accept"] = "stop"


@dataclass(frozen=True, kw_only=True)
class Latency:
    """A latency drawn uniformly between min and max (s) and the probability of a loss, for each
    sample, by numpy's PCG64 with `seed`. max None is min: a constant latency. Connections of
    one seed lose and delay the same samples, as one packet would."""

    min: float = 0.0
    max: float | None = None
    loss: float = 0.0
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class StepControl:
    """Settings of [step_control]; times in s, as numbers or "1/3000".

    tolerance: doubling, error per second of an output y over its nominal (1 where it has none) +
    |y|; ecco, residual energy of a step over `energy` (J), the energy that matters in the scene.
    min: the shortest step, accepted whatever its error. max: None is a period of the rate.
    """

    method: Literal["doubling", "ecco"]
    tolerance: float
    min: Seconds
    max: Seconds | None = None
    energy: float | None = None


@dataclass(frozen=True, kw_only=True)
class PowerPort:
    """The power into a plant is sign * effort . d(displacement)/dt.

    effort is an input (`fmu.port` or an entry of it, N and N.m), displacement an output of the same
    FMU that its effort works on (m and rad); other units count by their factors (`bonds`).
    """

    effort: str
    displacement: str
    sign: float = 1.0

    @property
    def fmu(self) -> str:
        return self.effort.partition(".")[0]


@dataclass(frozen=True, kw_only=True)
class SetSpring:
    """F = stiffness (set_position - position) + damping (set_velocity - velocity), entry by entry.

    set_position and set_velocity are inputs of one FMU (`fmu.port`), the far end; position is the
    near end, an input of that FMU at its own rate or an output. Gains are in the inputs' units;
    no damping is 0, and so is no set_velocity.
    """

    set_position: str
    position: str
    stiffness: tuple[float, ...]
    damping: tuple[float, ...] = ()
    set_velocity: str = ""

    @property
    def ports(self) -> tuple[str, ...]:
        """What the far end sets."""
        return tuple(p for p in (self.set_position, self.set_velocity) if p)
