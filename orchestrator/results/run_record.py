"""What run.json says of a run, as one record: it is written from this and read into it.

A run writes `RunSetup` and an end of "running" with its first row, and adds `RunEnding` when it
ends. `RunRecord` is both, with what is computed of the results afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.plain_data import plain
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.plan.dependency_order import AlgebraicLoop
from hapticlink.orchestrator.plan.sample_ages import Delay
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.system import Replacement


@dataclass(frozen=True)
class ClockSteps:
    """The first step of a clock, and the shortest and longest after it (s)."""

    first: float
    shortest: float
    longest: float


@dataclass(frozen=True)
class RecordedFmu:
    """`block`: the block of the haptic loop that the FMU is, or that it replaces."""

    rate: str
    timing: str
    block: str | None


@dataclass(frozen=True)
class RefusedHold:
    """A default hold that a connection does not take."""

    hold: str
    reason: str


@dataclass(frozen=True)
class Resumed:
    """The file of a state, and its time (s)."""

    state: str
    time: float


@dataclass(frozen=True)
class RunSetup:
    """What is known before a run; `scene` is its scene as tables, with all defaults."""

    scene: dict[str, Any]
    options: list[str]
    versions: dict[str, str]
    plugins: dict[str, dict[str, str | None]]
    seeds: dict[str, int]
    files: list[str]
    rates: list[str]
    """The names of the clocks, each with those of its tables of fewer rows."""
    clocks: dict[str, ClockSteps]
    stop_when: str
    base: str
    """The length of a tick."""
    fmus: dict[str, RecordedFmu]
    friction_speeds: dict[str, float]
    """v_f (rad/s or m/s) of the joints with friction."""
    coupling: str
    loops: list[AlgebraicLoop]
    connections: list[str]
    replaced: dict[str, Replacement]
    holds: dict[str, str]
    holds_that_did_not_fit: dict[str, RefusedHold]
    held_as: dict[str, str]
    """The kind of value that a hold keeps, such as a projector."""
    latencies: dict[str, Latency]
    substeps: dict[str, int]
    within_a_step: dict[str, str]
    """How plants take held inputs that vary within a step."""
    get_after_set: list[str]
    power_across_rates: list[str]
    not_recorded: list[str]
    """The outputs `fmu.port` of which an entry is not written in the rows of its rate."""
    events: list[tuple[float, str]] = field(default_factory=list)
    """Times (s) and texts of what `[[at]]` does, each with the first step that it acts on."""
    units: dict[str, str] = field(default_factory=dict)
    """By column of a table, as its FMU names it; columns without a unit are left out."""
    resumed: Resumed | None = None
    """The state from which the run went on, None for one from the start."""
    without_effect: list[str] = field(default_factory=list)
    """What the scene asks for that acts nowhere in this run, each with the reason."""


@dataclass(frozen=True)
class End:
    """How and when (s) a run ended: `asked` is the FMU that requested it, and how; `process` the
    one in which a run goes on, which has no time of its end yet."""

    reason: str = "running"
    time: float | None = None
    asked: str = ""
    process: int | None = None


@dataclass(frozen=True)
class RecordedFault:
    """The fault that ended a run: its class, time (s) and message."""

    kind: str
    time: float | None
    message: str


@dataclass(frozen=True)
class LinkCounts:
    """Of the samples of a connection with a latency."""

    sent: int
    lost: int
    overtaken: int


@dataclass(frozen=True)
class Premises:
    """Of a hold that bounds energy: its steps by entry, those outside the premises of its theorem,
    and the energy (J) `at_stake` in these, which the theorem does not cover."""

    steps: int
    outside: int
    at_stake: float


@dataclass(frozen=True)
class Timings:
    """Wall times (s) of building the scene, of the loop, of writing its tables as CSV, and of
    doStep by FMU, where its steps are long enough to be timed (.01 ms in the mean)."""

    build: float = 0.0
    run: float = 0.0
    tables: float = 0.0
    steps: dict[str, float] = field(default_factory=dict)


@dataclass
class Iterations:
    """Counts of a run's fixed-point iterations: steps that were iterated, iterations and rollbacks
    in all, the most iterations of a step, Jacobians evaluated by differences and by directional
    derivatives, and steps that did not converge."""

    steps: int = 0
    iterations: int = 0
    rollbacks: int = 0
    max_iterations: int = 0
    jacobians: int = 0
    directional_jacobians: int = 0
    unconverged: int = 0


@dataclass(frozen=True)
class StepErrors:
    """Of the steps of an FMU, `size` (s) the longest checked: the estimated sum of all e_k of an
    output, the largest e_k, and the output and time (s) of the latter (`run/step_check.py`)."""

    checked: int
    sum: float
    largest: float
    output: str
    time: float
    size: float


@dataclass(frozen=True)
class Energy:
    """Energies (J) of a connection from 0 to `until` (s), the newest sample of the source that the
    target has stepped past; symbols as in `run/energy/meter.py`."""

    generated: float
    held: float
    ideal: float
    until: float
    peak: float


@dataclass(frozen=True)
class RunEnding:
    """What is known when a run has ended. The defaults hold for a run that goes on or was killed.

    Keys of the mappings are names of FMUs or connections.
    """

    end: End = End()
    fault: RecordedFault | None = None
    """None for a regular end."""
    calls: dict[str, dict[str, int]] = field(default_factory=dict)
    delays: dict[str, Delay] = field(default_factory=dict)
    causal: bool = True
    """Whether no FMU reads a sample that is stamped later than the start of its step."""
    links: dict[str, LinkCounts] = field(default_factory=dict)
    premises: dict[str, Premises] = field(default_factory=dict)
    """Of the connections with `passive` or `nepce`."""
    overdrawn: dict[str, float] = field(default_factory=dict)
    """By set position, the energy (J) that its tank was short of at most: what the coupling gave
    beyond all that it was given."""
    isolated: dict[str, str] = field(default_factory=dict)
    """Why an FMU ran in a process of its own."""
    solvers: dict[str, str] = field(default_factory=dict)
    """What has integrated an FMU for model exchange."""
    logged: dict[str, dict[str, int]] = field(default_factory=dict)
    """The number of messages in fmus.log, by FMU and status."""
    unsaved: list[str] = field(default_factory=list)
    """The files of states that were asked for, and that the run ended before."""
    held_outputs: dict[str, int] = field(default_factory=dict)
    """How often outputs were held since they were not finite."""
    in_python: dict[str, str] = field(default_factory=dict)
    """The operations and holds that were carried out in Python rather than in C, with the
    reason."""
    real_time: dict[str, Any] | None = None
    """What became of a run in real time (`RealTimeRun.report`)."""
    network: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What became of the messages to FMUs on other computers, and their clocks
    (`Remote.network`)."""
    timings: Timings = Timings()
    iterations: Iterations | None = None
    unstable: str = ""
    """A message if sampling and holding generated more energy than was put in."""
    step_errors: dict[str, StepErrors] = field(default_factory=dict)
    energies: dict[str, Energy] | Literal["none"] = "none"
    """Of connections across rates, "none" where none carries power."""
    energies_within_a_rate: dict[str, Energy] = field(default_factory=dict)
    """Their inputs are held over the target's step, too."""

    @property
    def across(self) -> dict[str, Energy]:
        """The energies of connections across rates."""
        return {} if self.energies == "none" else self.energies

    @property
    def meters(self) -> dict[str, Energy]:
        """The energies of all connections, those across rates first."""
        return self.across | self.energies_within_a_rate


@dataclass(frozen=True)
class BlockEnergy:
    """Energy (J) that a block has generated at the end, and at most."""

    generated: float
    peak: float


@dataclass(frozen=True)
class PortEnergy(BlockEnergy):
    """Energy (J) generated at the user's port, when it was largest (s), that of each block, the
    works of single wrenches, and that of the hand on the handle, its absolute values summed
    (`analysis/findings/user_port.py`)."""

    time_of_peak: float
    blocks: dict[str, BlockEnergy]
    works: dict[str, float]
    hand_work: float = 0.0


@dataclass(frozen=True)
class HeldContacts:
    """What new frames of held contacts did to the mechanism (`analysis/findings/held_contacts.py`):
    energy (J) that they gave and took in all, the gain at the frame that is most beyond what the
    deepest contact had stored by then (J), and when (s), and the largest jump (N) of F_env and
    when."""

    given: float
    taken: float
    largest_gain: float
    time_of_gain: float
    stored: float
    largest_jump: float
    time_of_jump: float


@dataclass(frozen=True)
class NoticedError:
    """For how long (s) of how many a hand would notice the tracking error, the force (N) of this
    error where it is farthest beyond a threshold, beside the hand's, and when (s)."""

    seconds: float
    of: float
    error: float
    force: float
    time: float


@dataclass(frozen=True)
class Shaking:
    """The largest amplitude (m/s2) of a handle's acceleration at frequencies of vibration, and when
    (s)."""

    amplitude: float
    time: float


@dataclass(frozen=True)
class Noticed:
    """What a hand would notice (`analysis/findings/noticed.py`), None where it is not known."""

    tracking: NoticedError | None
    shaking: Shaking | None


@dataclass(frozen=True)
class RunRecord(RunEnding, RunSetup):
    """The content of run.json, which a run that was recovered has together with `recovered`."""

    user_port: PortEnergy | None = None
    held_contacts: HeldContacts | None = None
    noticed: dict[str, Noticed] = field(default_factory=dict)
    """By user, the first one's name empty."""
    warnings: list[str] | None = None
    """None of a run that goes on or was killed."""

    @property
    def begun(self) -> float:
        """The time (s) at which its rows begin; a record of an earlier version has no
        start_time."""
        return self.resumed.time if self.resumed else float(self.scene.get("start_time", 0.0))

    @property
    def depends_on_a_clock(self) -> bool:
        """Whether another run of the scene differs: not one with the arrivals of another."""
        in_time = self.real_time is not None and "arrivals" not in self.real_time
        return in_time or bool(self.network)


def content(section: RunSetup | RunEnding | PortEnergy | HeldContacts | Noticed) -> dict[str, Any]:
    """A section as run.json has it, in the same order; its end without what is not known."""
    values: dict[str, Any] = plain(section)
    if "end" in values:
        values["end"] = {k: v for k, v in values["end"].items() if v not in (None, "")}
    return values


def read_record(run: Mapping[str, Any], folder: Path | None) -> RunRecord:
    """The content of a run.json as a record. Raises InputFault where it is of another version, or
    was changed."""
    try:
        record: RunRecord = adapter(RunRecord).validate_python(run)
    except ValidationError as error:
        why = first_error(error)
    else:
        if isinstance(record.scene.get("title"), str):
            return record
        why = "scene.title: input should be a valid string"
    raise InputFault(f"{folder}/run.json: {why}: run the scene again")


def first_error(error: ValidationError) -> str:
    """The first error of a validation, with the keys that lead to it."""
    first = error.errors(include_url=False, include_input=False)[0]
    table = first["type"] == "dataclass_type"
    why = "input should be a valid dictionary" if table else first["msg"].lower()
    return f"{'.'.join(map(str, first['loc'])) or 'its content'}: {why}"
