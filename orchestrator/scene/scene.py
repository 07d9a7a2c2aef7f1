"""A scene: what the user wrote, as frozen records.

The blocks' own tables (linkage, device, controller, ...) are the records of
`components.specs`; this file adds rates, holds and the order of calls.

A block is simulated where its table is present: [linkage] the virtual mechanism, [graphics]
the virtual environment (not where the mechanism gives the directions itself), [device],
[controller] and [hand] theirs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Tag, TypeAdapter

from hapticlink.components.ports import Kind
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import ArmHand, ConstantHand, ProfileHand, SpringHand
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Linkage, Mechanism
from hapticlink.components.specs.quantities import Duration, Elapsed, Substeps
from hapticlink.orchestrator.base.faults import Finding
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.rates import AnyRate, Rate, Seconds
from hapticlink.orchestrator.scene.records import (
    SCHEMES,
    ForeignFmu,
    HoldName,
    Iteration,
    Latency,
    PowerPort,
    SetSpring,
    StepControl,
    Wire,
)
from hapticlink.orchestrator.scene.source import Origin, Source
from hapticlink.orchestrator.scene.toml_keys import Path


@dataclass(frozen=True, kw_only=True)
class Haptics:
    """The fast rate."""

    rate: Rate = 512
    """Communication rate of the blocks of the haptic loop."""


@dataclass(frozen=True, kw_only=True)
class Graphics(GraphicsCopy):
    """The slow rate, and the graphics copy of the mechanism that runs at it, pulled by a PD
    controller (section B.6)."""

    rate: AnyRate = 30
    """Frames: a rate, bounds and a seed, the times at which frames end, or a recorded trace."""
    phase: Seconds | None = None
    """End of the first frame of a fixed rate, at most a period; a period where left out."""
    align: Literal["exact", "tick"] | None = None
    """exact: frame i ends at i/rate; tick: at the first haptic tick at or after that. Exact for a
    fixed rate where left out; rates that vary are always on ticks."""


def _hand_type(table: Any) -> str:
    return (
        table.get("type", "constant")
        if isinstance(table, dict)
        else getattr(table, "type", "constant")
    )


Hand = Annotated[
    Annotated[ConstantHand, Tag("constant")]
    | Annotated[ProfileHand, Tag("profile")]
    | Annotated[ArmHand, Tag("arm")]
    | Annotated[SpringHand, Tag("spring")],
    Discriminator(_hand_type),
]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything a run needs. A block is simulated where its table is present."""

    __pydantic_config__ = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    title: str
    """Of figures and messages."""
    description: str = ""
    """What `hapticlink info` tells."""
    duration: Duration
    """Simulated time."""
    hold: HoldName = "zoh"
    """Hold on connections from a slow rate to a fast one: [holds](holds.md)."""
    downsampling: Annotated[str, HOLDS.names(lambda hold: hold.downsamples)] = "latest"
    """Hold on connections from a fast rate to a slow one: the latest sample, or the mean over the
    slow step."""
    holds: Mapping[str, HoldName] = field(default_factory=dict)
    """Another hold for a connection, by source, target or "source -> target"."""
    delays: Mapping[str, Elapsed | Latency] = field(default_factory=dict)
    """Latency of a connection, or a table of latency and loss, by the same names."""
    phases: Mapping[str, Seconds] = field(default_factory=dict)
    """End of an FMU's first step, by the FMU's name; whole periods follow."""
    kinds: Mapping[str, Literal[Kind, "none"]] = field(default_factory=dict)
    """What a signal is where its FMU does not say, by connection; "none" overrides its FMU."""
    power: tuple[PowerPort, ...] = ()
    """Efforts and displacements of FMUs other than the scene's own blocks."""
    spring: tuple[SetSpring, ...] = ()
    """Inputs of FMUs that set a spring within: [holds](holds.md), pspm."""
    substeps: Mapping[str, Substeps] = field(default_factory=dict)
    """Steps of a plant between two reads, its held inputs renewed at each; by the FMU's name."""
    get_after_set: tuple[str, ...] = ()
    """Plants whose feed-through may be read after new inputs are set, which FMI forbids between two
    steps."""
    coupling: Annotated[str, SCHEMES.names()] = "gauss-seidel"
    """Order of calls: jacobi is get all, set all, step all; [coupling](coupling.md)."""
    iteration: Iteration = field(default_factory=Iteration)
    """Of coupling = "iterated"."""
    step_control: StepControl | None = None
    """Steps chosen for accuracy."""
    sensing: Literal["ideal", "encoders"] = "ideal"
    """ideal: controller and mechanism get the hand's wrench and the true pose; encoders: the
    observer's."""
    mechanism_at: Literal["haptics", "graphics"] = "haptics"
    """Rate of the virtual mechanism."""
    directions_from: Literal["graphics", "mechanism"] = "graphics"
    """Who computes Lambda^-1, the mobility at the operational point, and P_c, the projector on the
    constrained directions ([theory](theory.md#what-the-hand-feels)): the graphics copy, or the
    mechanism itself."""
    local_model: bool = False
    """Holds the mechanism's D, W, w and J_h of (B.15) from the graphics rate:
    [local model](local-model.md)."""
    stop_when: str | None = None
    """A signal against a number, which ends the run in good order. Where left out,
    "haptic_device.workspace_margin < 0" where there is a device; "" is never."""
    haptics: Haptics = field(default_factory=Haptics)
    """The fast rate."""
    graphics: Graphics | None = None
    """The slow rate and the graphics copy, the block `virtual_environment`."""
    linkage: Linkage | None = None
    """The mechanism, the block `virtual_mechanism`: [mechanisms](mechanisms.md)."""
    contacts: Contacts | None = None
    """What the links can touch."""
    mechanism: Mechanism = field(default_factory=Mechanism)
    """Time integration of the mechanism."""
    directions: Directions = field(default_factory=Directions)
    """The test for constrained directions, those in which the closures let nothing move."""
    device: Device | None = None
    """The twin pantograph, the block `haptic_device`: [device](device.md)."""
    controller: Controller | None = None
    """The block `controller`."""
    hand: Hand | None = None
    """The user, the block `hand`."""
    hands: Mapping[str, Hand] = field(default_factory=dict)
    """Hands at the further points of the linkage, by the point's name."""
    fmu: tuple[ForeignFmu, ...] = ()
    """Anyone's FMUs: [foreign FMUs](foreign-fmus.md)."""
    connection: tuple[Wire, ...] = ()
    """Connections of them."""
    faults: Faults = field(default_factory=Faults)
    """What a run does about an FMU that fails: [faults](faults.md)."""
    isolate: bool = False
    """Runs every FMU in a process of its own."""
    packaging: Literal["python", "native"] = "python"
    """native: compiles the scene's own blocks, which then need no Python: [FMUs](fmus.md)."""

    def place(self, path: Path, message: str) -> Finding:
        """What is wrong at a path of the scene; where it was read from a file, with its line."""
        return Finding(".".join(map(str, path)), message)

    @property
    def source(self) -> Source | None:
        """What it was read from; None where it was made or changed in Python."""
        return None

    def tables(self) -> dict[str, Any]:
        """The scene as plain data."""
        return asdict(self.plain())

    def plain(self) -> Scene:
        """The scene without where it was written."""
        return Scene(**{f.name: getattr(self, f.name) for f in fields(Scene)})

    @property
    def ends_when(self) -> str:
        """The condition in force, "" where there is none."""
        if self.stop_when is None:
            return "haptic_device.workspace_margin < 0" if self.device else ""
        return self.stop_when


@dataclass(frozen=True, kw_only=True)
class WrittenScene(Scene):
    """A scene that was read, which knows where its keys were written; so do its changed copies."""

    origin: Origin = field(compare=False, repr=False)
    written: Scene = field(compare=False, repr=False)
    """What was read, before any change."""

    def place(self, path: Path, message: str) -> Finding:
        return self.origin.finding(path, message)

    @property
    def source(self) -> Source | None:
        return self.origin.source if self.plain() == self.written else None


@cache
def adapter() -> TypeAdapter[Scene]:
    """What reads a scene. Making it takes ten times as long as a scene; sweeps read hundreds."""
    return TypeAdapter(Scene)
