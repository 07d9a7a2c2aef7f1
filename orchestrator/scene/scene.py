"""The scene: a description of an experiment, as frozen records.

The tables of the blocks (linkage, device, controller, ...) are the records of `components.specs`;
this file adds rates, holds and the coupling scheme.

A block is simulated if its table is present: [linkage] the virtual mechanism, [graphics] the
virtual environment (only if another block uses an output of it), [device], [controller] and [hand]
the blocks of these names. [hands.NAME], [devices.NAME] and [controllers.NAME] are those at the
further point NAME, blocks `hand_NAME`, `haptic_device_NAME` and `controller_NAME`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Tag

from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.ports import Kind
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    FingertipHand,
    ProfileHand,
    SpringHand,
)
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Linkage, Mechanism
from hapticlink.components.specs.quantities import Duration, Elapsed, Substeps
from hapticlink.orchestrator.base import shelf
from hapticlink.orchestrator.base.errors import Finding
from hapticlink.orchestrator.base.plain_data import Plain, plain
from hapticlink.orchestrator.base.signal_names import WORKSPACE_MARGIN, by_user
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.boards import DRIVERS as DRIVERS  # registers the drivers
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.rates import AnyRate, Rate, Seconds
from hapticlink.orchestrator.scene.scene_source import Source
from hapticlink.orchestrator.scene.scene_tables import (
    SCHEMES,
    ForeignFmu,
    HoldName,
    Iteration,
    Latency,
    PowerPort,
    RecordTable,
    SetSpring,
    TimedEvent,
    Wire,
)
from hapticlink.orchestrator.scene.toml_keys import Path, written_path


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
    """Graphics rate: a number, bounds and a seed, the times at which frames end, or a recorded
    trace."""
    phase: Seconds | None = None
    """End of the first frame of a fixed rate, at most a period; by default a period."""
    align: Literal["exact", "tick"] | None = None
    """exact: frame i ends at i/rate; tick: at the first haptic tick at or after that. By default
    exact for a fixed rate; varying rates are always on ticks."""


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
    | Annotated[SpringHand, Tag("spring")]
    | Annotated[FingertipHand, Tag("fingertip")],
    Discriminator(_hand_type),
]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A complete experiment. A block is simulated if its table is present."""

    __pydantic_config__ = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    title: str
    """Title of figures and messages."""
    description: str = ""
    """Text that `hapticlink info` prints."""
    format: Literal[2] = 2
    """Version of the format of scenes."""
    experiment: Literal["", "chapter 6", "section B.6"] = ""
    """The report's experiment that the scene stands for; the summary lists the differences."""
    duration: Duration
    """Simulated time."""
    start_time: Elapsed = 0.0
    """Time at which the run begins, and which its FMUs are told: [another time than
    0](scenarios.md#a-run-that-begins-at-another-time-than-0)."""
    resume: str = ""
    """State of a run, from which this one goes on, relative to the scene's file: [save, resume,
    branch](resume.md)."""
    hold: HoldName = "zoh"
    """Hold on connections from a slow rate to a fast one: [holds](holds.md)."""
    downsampling: Annotated[str, HOLDS.names(lambda hold: hold.downsamples)] = "latest"
    """Hold on connections from a fast rate to a slow one: the latest sample, or the mean over the
    slow step."""
    computing_time: Elapsed = 0.0
    """Time after which the result of a step is there that is taken when it begins: [the mechanism
    at the graphics rate](holds.md#the-mechanism-at-the-graphics-rate)."""
    holds: Mapping[str, HoldName] = field(default_factory=dict)
    """Hold of single connections, by source, target or "source -> target"."""
    delays: Mapping[str, Elapsed | Latency] = field(default_factory=dict)
    """Latency of single connections, or a table of latency and loss, by the same names."""
    phases: Mapping[str, Seconds] = field(default_factory=dict)
    """End of an FMU's first step, by the FMU's name; whole periods follow."""
    kinds: Mapping[str, Literal[Kind, "none"]] = field(default_factory=dict)
    """Kind of a signal, by connection, where its FMU does not declare it; "none" overrides the
    FMU's declaration."""
    power: tuple[PowerPort, ...] = ()
    """Power ports of FMUs other than the scene's own blocks."""
    spring: tuple[SetSpring, ...] = ()
    """Spring-dampers within FMUs whose set position is an input: [holds](holds.md), pspm."""
    substeps: Mapping[str, Substeps] = field(default_factory=dict)
    """Number of doSteps of a plant per communication step, held inputs updated before each; by the
    FMU's name."""
    get_after_set: tuple[str, ...] = ()
    """Plants whose feed-through outputs are read after new inputs are set without a doStep between,
    which FMI does not allow."""
    coupling: Annotated[str, SCHEMES.names()] = "gauss-seidel"
    """Coupling scheme, the order of calls; jacobi is get all, set all, step all:
    [coupling](coupling.md)."""
    iteration: Iteration = field(default_factory=Iteration)
    """Settings of coupling = "iterated"."""
    sensing: Literal["ideal", "encoders"] = "ideal"
    """ideal: controller and mechanism get the hand's wrench and the true pose; encoders: those that
    the observer estimates."""
    mechanism_at: Literal["haptics", "graphics"] = "haptics"
    """Rate of the virtual mechanism."""
    directions_from: Literal["graphics", "mechanism"] = "graphics"
    """Block that computes Lambda^-1, the mobility at the operational point, and P_c, the projector
    on the constrained directions ([theory](theory.md#what-the-hand-feels)): the graphics copy, or
    the mechanism itself."""
    local_model: bool = False
    """Whether the mechanism uses D, W, w and J_h of (B.15) computed at the graphics rate and held:
    [local model](local-model.md)."""
    stop_when: str | None = None
    """Comparison of a signal with a number that ends the run early, without an error. By default
    "haptic_device.workspace_margin < 0" if the device has that output; "" for never."""
    haptics: Haptics = field(default_factory=Haptics)
    """The fast rate."""
    graphics: Graphics | None = None
    """The slow rate and the graphics copy, the block `virtual_environment`."""
    linkage: Linkage | None = None
    """The mechanism, the block `virtual_mechanism`: [mechanisms](mechanisms.md)."""
    contacts: Contacts | None = None
    """Obstacles that the links can touch."""
    mechanism: Mechanism = field(default_factory=Mechanism)
    """Time integration of the mechanism."""
    directions: Directions = field(default_factory=Directions)
    """Detection of constrained directions, in which the loop closures allow no motion."""
    device: Device | None = None
    """The block `haptic_device`: [device](device.md)."""
    controller: Controller | None = None
    """The block `controller`."""
    hand: Hand | None = None
    """The user, the block `hand`."""
    hands: Mapping[str, Hand] = field(default_factory=dict)
    """Hands at the further points of the linkage, by the point's name."""
    devices: Mapping[str, Device] = field(default_factory=dict)
    """Devices that further users hold, by the name of the point that each renders:
    [two users](coupling.md#two-users-on-one-linkage)."""
    controllers: Mapping[str, Controller] = field(default_factory=dict)
    """Controllers of these devices, by the same name; by default as [controller]."""
    fmu: tuple[ForeignFmu, ...] = ()
    """Further FMUs: [foreign FMUs](foreign-fmus.md)."""
    connection: tuple[Wire, ...] = ()
    """Connections to and from them."""
    at: tuple[TimedEvent, ...] = ()
    """What happens at given times: [scenarios](scenarios.md)."""
    record: RecordTable = field(default_factory=RecordTable)
    """What is written, and how often."""
    faults: Faults = field(default_factory=Faults)
    """How a run reacts to an FMU that fails: [faults](faults.md)."""
    isolate: bool = False
    """Runs every FMU in a process of its own."""
    packaging: Literal["python", "native"] = "python"
    """native: the scene's own blocks are compiled, and then need no Python: [FMUs](fmus.md)."""

    def __repr__(self) -> str:
        rates = {"haptics": self.haptics.rate, "graphics": self.graphics and self.graphics.rate}
        links, users = self.linkage, self.all_devices
        mechanism = links and f"{len(links.body)} bodies, {len(links.loop)} closed loops"
        blocks = [*(["device"] * len(users)), *(f.name or f.path or "unnamed" for f in self.fmu)]
        lines = (
            self.title,
            f"mechanism: {mechanism or 'none'}; {', '.join(blocks) or 'no device'}",
            ", ".join(
                f"{name} at {rate} Hz"
                if isinstance(rate, int | float | str)
                else f"{name} at a varying rate"
                for name, rate in rates.items()
                if rate
            ),
            f"hold {self.hold}, coupling {self.coupling}, {self.duration:g} s",
        )
        return "\n  ".join(lines)

    def place(self, path: Path, message: str) -> Finding:
        """A finding at a path of the scene, with its line if the scene was read from a file."""
        return Finding(".".join(map(str, path)), message)

    @property
    def source(self) -> Source | None:
        """What the scene was read from; None where it was created or changed in Python."""
        return None

    @property
    def space(self) -> PortSpace:
        """That of the ports between its blocks."""
        moved = self.linkage or self.device
        return moved.space if moved else PLANE

    @property
    def all_hands(self) -> dict[str, Hand]:
        """The hands by the points that they hold; the first one's name is empty."""
        return by_user(self.hand, self.hands)

    @property
    def all_devices(self) -> dict[str, Device]:
        """The devices by user, who is named by the point; the first one's name is empty."""
        return by_user(self.device, self.devices)

    @property
    def all_controllers(self) -> dict[str, Controller]:
        """The controllers of `all_devices`, by user."""
        own = self.controller or Controller()
        written = by_user(
            self.controller, {name: self.controllers.get(name, own) for name in self.devices}
        )
        return {user: self._with_bias(user, controller) for user, controller in written.items()}

    def _with_bias(self, user: str, controller: Controller) -> Controller:
        """The controller with its default bias, which follows from the device's mass."""
        device = self.all_devices.get(user)
        if controller.bias or not (device and device.is_light and controller.impedance):
            return controller
        return replace(controller, bias="full")

    @property
    def named_holds(self) -> dict[str, str]:
        """The holds of single connections, of [holds] and of [[connection]] tables."""
        own = {w.name: w.hold for w in self.connection if w.hold}
        return {**self.holds, **own}

    def tables(self) -> dict[str, Any]:
        """The scene as plain data."""
        shared = {name: _tables_of(getattr(self, name)) for name in ("linkage", "device")}
        return Plain(plain(vars(self.plain()) | shared))

    def plain(self) -> Scene:
        """A copy of the scene without its origin."""
        return Scene(**{f.name: getattr(self, f.name) for f in fields(Scene)})

    @property
    def stop_time(self) -> float:
        """The time (s) at which the duration is over."""
        return float(exact(self.start_time) + exact(self.duration))

    @property
    def ends_when(self) -> str:
        """The condition that ends the run, its default included; "" where there is none."""
        if self.stop_when is None:
            simulated = self.device and not (self.device.driver and self.device.driver.active)
            return f"{WORKSPACE_MARGIN} < 0" if simulated else ""
        return self.stop_when


_TABLES: shelf.Shelf[tuple[object, Any]] = shelf.Shelf(8)


def _tables_of(record: object) -> Any:
    """A record that many scenes share, as plain data."""
    known = _TABLES.take(lambda item: item[0] is record)
    known = known or (record, record and Plain(plain(record)))
    _TABLES.put(known)
    return known[1]


@dataclass(frozen=True, kw_only=True, repr=False)
class WrittenScene(Scene):
    """A scene that was read, with the file and line of its keys; changed copies keep them."""

    read_from: Source = field(compare=False, repr=False)
    """What it was read from, with the options still to be applied."""
    origin: Source = field(compare=False, repr=False)
    """The same with its options applied."""
    written: Scene = field(compare=False, repr=False)
    """The scene as it was read, before any change in Python."""
    signals: Mapping[Path, int] = field(compare=False, repr=False, default_factory=dict)
    """Of what is made for connections from signals, as of `written_path`."""

    def place(self, path: Path, message: str) -> Finding:
        return self.origin.finding(written_path(path, self.signals), message)

    @property
    def source(self) -> Source | None:
        return self.read_from if self.plain() == self.written else None
