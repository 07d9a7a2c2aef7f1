"""A scene: what the user wrote, as frozen records.

The blocks' own tables (linkage, device, controller, ...) are the records of
`components.specs`; this file adds rates, holds and the order of calls.

A block is simulated where its table is present: [linkage] the virtual mechanism, [graphics]
the virtual environment (not where the mechanism gives the directions itself), [device],
[controller] and [hand] theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Tag, TypeAdapter

from hapticlink.components.ports import Kind
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import ArmHand, ConstantHand, ProfileHand, SpringHand
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Linkage, Mechanism
from hapticlink.orchestrator.base.faults import Finding, unplaced
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.scene.records import (
    AnyRate,
    ForeignFmu,
    Iteration,
    Latency,
    PowerPort,
    Rate,
    Seconds,
    SetSpring,
    StepControl,
    Wire,
)


@dataclass(frozen=True, kw_only=True)
class Haptics:
    """The fast rate (Hz)."""

    rate: Rate = 512


@dataclass(frozen=True, kw_only=True)
class Graphics(GraphicsCopy):
    """The slow rate, and the graphics copy that runs at it.

    rate: Hz, bounds and a seed, or the times (s) at which frames end. align "exact" ends
    frame i at i/rate, "tick" at the first haptic tick at or after it; None is "exact" for a
    fixed rate, and rates that vary are always on ticks. phase (s) is the end of the first frame
    of a fixed rate, None a whole period. A file may give a recorded trace: `{ trace = FILE }`.
    """

    rate: AnyRate = 30
    phase: Seconds | None = None
    align: Literal["exact", "tick"] | None = None


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
    """Everything a run needs. duration in s; see the field's own records for the tables.

    sensing "ideal" gives controller and mechanism the hand's wrench and the true pose, "encoders"
    the observer's (it stands here, not in [device]). mechanism_at: the rate of the virtual
    mechanism. directions_from: who computes Lambda_inv and P_c, the graphics copy or the mechanism
    itself. local_model holds the mechanism's D, W, w and J_h from the graphics rate (B.15). hands
    are those at the further points of the linkage, by name. hold is the default from a slow rate to
    a fast one, downsampling from a fast to a slow; holds gives others by source
    (`virtual_environment.P_c`), target or `source -> target`. delays by the same names: a latency
    in s, or one drawn from a seed, and losses. phases: by FMU, the end of its first step (s), after
    which come whole periods. kinds says what a signal is where its FMU does not, or "none" for
    what it does say. power pairs efforts with displacements of FMUs that do not declare them,
    spring says which inputs set a spring within one. substeps: steps of a plant between two reads,
    its held inputs renewed at each. get_after_set: plants whose feed-through may be read after new
    inputs are set, which FMI forbids between two steps.
    stop_when, a signal against a number, ends the run in good order: None takes the device's
    workspace where there is a device, "" is never. isolate runs every FMU in a process of its own.
    packaging "native" compiles the scene's own blocks, which then need no Python.
    A file may also say `extends`, a scene over which its own tables are laid.
    """

    __pydantic_config__ = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    title: str
    description: str = ""
    duration: float
    hold: str = "zoh"
    downsampling: str = "latest"
    holds: Mapping[str, str] = field(default_factory=dict)
    delays: Mapping[str, float | Latency] = field(default_factory=dict)
    phases: Mapping[str, Seconds] = field(default_factory=dict)
    kinds: Mapping[str, Kind | Literal["none"]] = field(default_factory=dict)
    power: tuple[PowerPort, ...] = ()
    spring: tuple[SetSpring, ...] = ()
    substeps: Mapping[str, int] = field(default_factory=dict)
    get_after_set: tuple[str, ...] = ()
    coupling: Literal["gauss-seidel", "jacobi", "gauss-seidel-plants", "iterated"] = "gauss-seidel"
    iteration: Iteration = field(default_factory=Iteration)
    step_control: StepControl | None = None
    sensing: Literal["ideal", "encoders"] = "ideal"
    mechanism_at: Literal["haptics", "graphics"] = "haptics"
    directions_from: Literal["graphics", "mechanism"] = "graphics"
    local_model: bool = False
    stop_when: str | None = None
    haptics: Haptics = field(default_factory=Haptics)
    graphics: Graphics | None = None
    linkage: Linkage | None = None
    contacts: Contacts | None = None
    mechanism: Mechanism = field(default_factory=Mechanism)
    directions: Directions = field(default_factory=Directions)
    device: Device | None = None
    controller: Controller | None = None
    hand: Hand | None = None
    hands: Mapping[str, Hand] = field(default_factory=dict)
    fmu: tuple[ForeignFmu, ...] = ()
    connection: tuple[Wire, ...] = ()
    faults: Faults = field(default_factory=Faults)
    isolate: bool = False
    packaging: Literal["python", "native"] = "python"

    @property
    def place(self) -> Callable[[tuple[str | int, ...], str], Finding]:
        """Makes a finding at a path of the scene; where it was read from a file, with its line."""
        return self.__dict__.get("_place", unplaced)

    @property
    def ends_when(self) -> str:
        """The condition in force, "" where there is none."""
        if self.stop_when is None:
            return "haptic_device.workspace_margin < 0" if self.device else ""
        return self.stop_when


@cache
def adapter() -> TypeAdapter[Scene]:
    """What reads a scene. Making it takes ten times as long as a scene; sweeps read hundreds."""
    return TypeAdapter(Scene)
