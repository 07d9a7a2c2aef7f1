"""A scene's tables that do not describe components, as frozen records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

from hapticlink.components.blocks import BLOCKS
from hapticlink.components.registry import Registry
from hapticlink.components.specs.quantities import Elapsed, Quantity, Seed
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.rates import AnyRate

SCHEMES: Registry[Any] = Registry("scheme", {})
"""Coupling schemes, registered by `plan.schemes`, which this package may not import."""
HoldName = Annotated[str, HOLDS.names()]

OWN = "the variable's own"
"""The unit of values of a foreign FMU's variables."""
_Row = tuple[bool | Annotated[int | float, Quantity(OWN)], ...]
Value = (
    bool
    | Annotated[int, Quantity(OWN)]
    | Annotated[float, Quantity(OWN)]
    | str
    | _Row
    | tuple[_Row, ...]
    | tuple[tuple[_Row, ...], ...]
)


@dataclass(frozen=True, kw_only=True)
class ForeignFmu:
    """An FMU for co-simulation (FMI 2.0 or 3.0), or a block that is built into one."""

    name: str = ""
    """Its name in connections and results: letters, digits and _; that of the block that it
    replaces."""
    replaces: str | None = None
    """The block of the haptic loop whose place it takes, with the connections of the ports that
    both have: [foreign FMUs](swap-an-fmu.md)."""
    path: str | None = None
    """Its file, relative to the scene's file."""
    map: Mapping[str, str | tuple[str, ...]] = field(default_factory=dict)
    """What each port of the replaced block is in the FMU: a variable, or one for each entry of a
    vector, with a sign or factor where it has another one (`-tau_{x,y,z}`, `pos*0.001`). Names
    that differ only in brackets, underscores or case need none."""
    block: Annotated[str, BLOCKS.names()] | None = None
    """In place of a file, the block to build ([extending](extending.md#a-block))."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the block, by name."""
    engine: Literal["mujoco"] | None = None
    """In place of a file, the physics engine that makes the block:
    [MuJoCo](engine.md)."""
    rate: Literal["haptics", "graphics"] | AnyRate | None = None
    """Its communication rate: one of the scene's, or its own, written as graphics.rate is. By
    default that of the block that it replaces, else "haptics"."""
    timing: Literal["sampled", "continuous", "frame"] | None = None
    """sampled: doStep(t, h) computes y(t) from the inputs at t; continuous: y(t + h); frame: y(t),
    which is known at t + h. By default
    what the FMU declares, else that of the block that it replaces, else "continuous"."""
    interface: Literal["co-simulation", "model-exchange"] | None = None
    """By which of its interfaces an FMU with both is run; by default co-simulation, where it has
    that. For model exchange a [solver](foreign-fmus.md#model-exchange) integrates it."""
    tolerance: Annotated[float | None, Quantity("1", gt=0, lt=1)] = None
    """Relative tolerance for the solver in it, or for it; by default that of its
    DefaultExperiment, for model exchange 1e-5 without one."""
    start: Mapping[str, Value] = field(default_factory=dict)
    """Start values of inputs and parameters by name; a list for a whole vector, lists of rows for a
    matrix."""
    derivatives: Mapping[str, str] = field(default_factory=dict)
    """For an output, the output that is its time derivative, where the FMU does not declare it."""
    isolate: bool = False
    """Runs it in a process of its own."""
    hardware: bool = False
    """It drives hardware: it runs in real time only, and ticks that are late are skipped
    ([real time](real-time.md#hardware))."""

    def __post_init__(self) -> None:
        if self.replaces and not self.name:
            object.__setattr__(self, "name", self.replaces)


@dataclass(frozen=True, kw_only=True)
class Wire:
    """A connection of a scalar or a whole vector, between any FMUs of the scene. A connection to
    an input of a block replaces that of the haptic loop."""

    from_: Annotated[str, Field(alias="from")]
    """The output, `fmu.variable`."""
    to: str
    """The input, `fmu.variable`."""
    hold: HoldName | None = None
    """Its hold; by default that of the scene."""
    factor: Annotated[float, Quantity("1")] = 1.0
    """The input is factor y + offset, after the conversion of units; not 0."""
    offset: Annotated[float, Quantity(OWN)] = 0.0
    """See `factor`."""
    convert: bool = True
    """Whether to convert between the units of the two ends."""

    @property
    def name(self) -> str:
        return f"{self.from_} -> {self.to}"


RecordRate = Annotated[float, Quantity("Hz", ge=1e-5, le=1_000_000)]


@dataclass(frozen=True, kw_only=True)
class RecordTable:
    """What a run writes. Outputs that are neither written nor read are not fetched from their
    FMUs:
    [what is recorded](fmus.md#what-is-fetched-and-recorded)."""

    signals: Literal["all", "connected", "none"] | tuple[str, ...] | Mapping[str, RecordRate] = (
        "all"
    )
    """all: every output; connected: those that a connection reads; none: no table; or a list of
    FMUs, for all of their outputs, of variables `fmu.port` and entries `fmu.port[1]`: outputs,
    inputs, locals and parameters. `*` stands for anything: `plant.*` are all variables of one. Or a
    table of these with the rate (Hz) of their rows, of which the first that fits a variable
    counts, at most that of its FMU: `{ "plant.*" = 512, "controller.*" = 32 }`."""
    every: Annotated[int, Quantity("1", ge=1, le=1_000_000)] = 1
    """A rate gets a row every so many of its communication points, from t = 0 on, and at the last
    one within the scene's duration."""
    format: Literal["csv", "rows"] = "csv"
    """csv; or rows, the header of the CSV and a line feed, then rows of doubles, which take less
    than half the time to write and almost none to read, and texts
    apart in `<rate>.texts`."""


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """The fixed-point iteration of `coupling = "iterated"`: it repeats a communication step until
    connected plants of one rate agree."""

    method: Literal["aitken", "newton"] = "aitken"
    """Fixed point with Aitken's relaxation, or Newton."""
    tolerance: Annotated[float, Quantity("1", gt=0, lt=1)] = 1e-9
    """Outputs y agree where they differ by at most tolerance (1 + |y|)."""
    most: Annotated[int, Quantity("1", ge=1, le=10000)] = 50
    """Largest number of iterations of a step, without those that evaluate Newton's Jacobian."""
    interpolation: Annotated[str, HOLDS.names(lambda hold: hold.interpolates)] = "foh"
    """Hold on connections between plants of one rate: zoh, the value at the end of the step; foh,
    linear over the step; second-order; hermite, which needs derivatives (foh without them)."""
    unconverged: Literal["stop", "accept"] = "stop"
    """Without convergence, stop the run or accept the last iterate."""


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Latency and loss of each sample of a connection, drawn by numpy's PCG64. Connections with the
    same seed lose and delay the same samples, as if they were sent in one packet."""

    min: Elapsed = 0.0
    """Smallest latency."""
    max: Elapsed | None = None
    """Largest latency; by default `min`, a constant latency."""
    loss: Annotated[float, Quantity("1", ge=0, le=1)] = 0.0
    """Probability that a sample is lost."""
    seed: Seed = 0
    """Seed of the generator."""


@dataclass(frozen=True, kw_only=True)
class TimedEvent:
    """What happens at a time of a run ([scenarios](scenarios.md)): values that are set, and inputs
    that are disturbed for a while, in place of what their connections bring."""

    time: Elapsed
    """When: an FMU takes it with its first step from then on."""
    until: Elapsed | None = None
    """End of `override`, `freeze` and `noise`; by default that of the run. What is `set` stays."""
    set: Mapping[str, Value] = field(default_factory=dict)
    """Values of tunable parameters and of inputs that nothing feeds, `fmu.port`, in the FMU's
    units; or `graphics.rate`, a number (Hz): steps then end on haptic ticks."""
    override: Mapping[str, Value] = field(default_factory=dict)
    """Values of inputs that a connection feeds, `fmu.port`, in the FMU's units."""
    freeze: tuple[str, ...] = ()
    """Inputs, `fmu.port`, that keep the value that they have at that time."""
    noise: Mapping[str, Annotated[float, Quantity(OWN, gt=0)]] = field(default_factory=dict)
    """Standard deviation of normal noise on each entry of an input, `fmu.port`, in the source's
    units, drawn at each step by numpy's PCG64."""
    seed: Seed = 0
    """Seed of the noise."""


@dataclass(frozen=True, kw_only=True)
class PowerPort:
    """A power port: the power into a plant is sign * effort . d(displacement)/dt."""

    effort: str
    """An input, `fmu.port` or an entry of it (N and N.m; other units are converted)."""
    displacement: str
    """The conjugate displacement, an output of the same FMU (m and rad)."""
    sign: Annotated[float, Quantity("1", ge=-1, le=1)] = 1.0
    """1, or -1 where the effort acts against the displacement."""

    @property
    def fmu(self) -> str:
        return self.effort.partition(".")[0]


@dataclass(frozen=True, kw_only=True)
class SetSpring:
    """A spring-damper within an FMU, F = stiffness (set_position - position) + damping
    (set_velocity - velocity), entry by entry, whose far end is set by an input."""

    set_position: str
    """The input that sets the far end, `fmu.port`."""
    position: str
    """The near end: an input of that FMU at its own rate, or an output of it."""
    stiffness: tuple[Annotated[float, Quantity(OWN, ge=0)], ...]
    """Stiffness, entry by entry."""
    damping: tuple[Annotated[float, Quantity(OWN, ge=0)], ...] = ()
    """Damping, entry by entry; by default 0."""
    set_velocity: str = ""
    """The input that sets the velocity of the far end; by default it is 0."""
    velocity: str = ""
    """Of a sampled FMU, the velocity of the near end, an input or an output of it; by default the
    difference of two positions."""
    force: str = ""
    """The output that is F, which acts with - on the FMU that sets the far end: with it the energy
    that either side puts in is available to both."""
    mobility: str = ""
    """The input with the mobility of both ends, where F is all that moves them apart."""

    @property
    def ports(self) -> tuple[str, ...]:
        """The inputs that set the far end: set position, and set velocity if there is one."""
        return tuple(p for p in (self.set_position, self.set_velocity) if p)

    @property
    def ends(self) -> tuple[str, ...]:
        """Both ends, their rates and the mobility, "" for what is not declared."""
        return self.set_position, self.position, self.set_velocity, self.velocity, self.mobility
