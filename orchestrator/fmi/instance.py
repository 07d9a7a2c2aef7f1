"""The interface of a loaded FMU, implemented in this process (`calls_of_fmi`, `fmi3_differences`)
and in a process of its own (`isolated`)."""

from __future__ import annotations

import ctypes
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import Diverged, Fault, FmuFault
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.units import factors_and_offsets
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, Scalar

if TYPE_CHECKING:  # a worker process need not load what reads scenes
    from hapticlink.orchestrator.fmi.start_values import Starts

GROWTH = 1e12
"""Times the larger of its start and its nominal, for an output that states no bound."""
UNKNOWN_GROWTH = 1e100
"""The same for one without a unit, which may stand for infinity by a larger number: it diverges
where it grows beyond."""
_CALLS = ("get", "rollback", "save", "set", "step")


class StepState(ctypes.Structure):
    """Where an instance stands, in memory that the compiled loop shares.

    time: where the instance stands. begin, size, end: of its newest step. step_time: spent in
    doStep. All in s. ended: whether it has requested the end of the simulation. waiting: from
    when on there are settings that it is to take before a step, infinity where there are none.
    setter: the key of the Setter whose values its inputs have, 0 where that is not known. altered:
    the number of its calls that changed how this process rounds numbers. The others count the calls
    of its functions in the loop."""

    _fields_ = (
        *((n, ctypes.c_double) for n in ("time", "begin", "size", "end", "step_time", "waiting")),
        *((name, ctypes.c_int64) for name in ("ended", "setter", "altered")),
        *((name, ctypes.c_int64) for name in ("gets", "sets", "steps", "saves", "rollbacks")),
    )

    def __init__(self) -> None:
        super().__init__(waiting=math.inf)

    def calls(self) -> dict[str, int]:
        """The number of calls of the loop by kind, without those that were not made."""
        counts = {name: getattr(self, name + "s") for name in _CALLS}
        return {name: count for name, count in counts.items() if count}

    def start(self) -> None:
        """Count from here."""
        for name in _CALLS:
            setattr(self, name + "s", 0)


class OutputBounds:
    """Bounds on the magnitude of `outputs`, a view that is read at each check: a run that exceeds
    one has diverged, though its numbers are still finite. Before `start` an output only has to be
    finite."""

    def __init__(self, description: Description, outputs: Vector) -> None:
        self._scalars, self._outputs = description.outputs, outputs
        self._nominal = np.array([s.nominal for s in self._scalars])
        self._bounds = np.array([_bound(s) for s in self._scalars])
        self._unknown = np.array([_is_unknown(s) for s in self._scalars], bool)
        self.inverse, self._shares = np.zeros(len(outputs)), np.zeros(len(outputs))
        self._before = np.zeros(len(outputs))

    def start(self) -> None:
        """Sets the bounds from the start values. Integers have the bounds of their types."""
        scales = np.maximum(np.abs(self._outputs), self._nominal)
        grown = np.where(self._unknown, UNKNOWN_GROWTH, GROWTH) * scales
        self._before[self._unknown] = np.inf
        self.inverse[:] = 1.0 / np.where(np.isnan(self._bounds), grown, self._bounds)

    def forget(self) -> None:
        """Stand as before `start`."""
        self.inverse[:] = self._shares[:] = self._before[:] = 0.0

    def saved(self) -> Vector:
        """How far outputs without a unit were beyond their bounds, which `find_diverged` needs."""
        return self._before.copy()

    def restore(self, saved: Vector) -> None:
        if len(saved) == len(self._before):  # else other outputs are recorded
            self._before[:] = saved

    def hold(self) -> bool:
        """Whether all outputs are certainly finite and within their bounds: one pass over the
        vector, since this is asked at every read."""
        np.multiply(self._outputs, self.inverse, out=self._shares)
        return bool(self._shares.dot(self._shares) <= 1.0)  # not where one is NaN or infinite

    def find_diverged(self) -> int | None:
        """The first output that is beyond its bound, without a unit further than when it was last
        found there; None where there is none."""
        shares = np.abs(self._outputs) * self.inverse
        diverged = (shares > 1.0) & (shares > self._before)
        unknown = self._before > 0.0
        self._before[unknown] = np.where(shares > 1.0, shares, np.inf)[unknown]
        return int(np.argmax(diverged)) if diverged.any() else None


def _bound(scalar: Scalar) -> float:
    """The bound that an output has whatever its start value is; NaN without one."""
    if scalar.bound:
        return scalar.bound
    return np.nan if scalar.type in CONTINUOUS else np.inf


def _is_unknown(scalar: Scalar) -> bool:
    """Whether nothing is known of the magnitude of an output."""
    return not scalar.bound and scalar.type in CONTINUOUS and scalar.unit is None


class Instance(ABC):
    """A loaded FMU, from instantiation to the removal of its folder. As a context manager it raises
    FmuFault if the FMU fails while it is closed and nothing else has failed.

    outputs: the view that `get` fills. held: number of outputs held at their last value by
    `faults.nan`. good: the last finite outputs, None unless these are held. place: where the
    instance stands. recorded_only: the outputs, by name, that are only read where the table's next
    row is written (`row_due`).
    """

    in_c: bool = True
    """Whether its functions may be called by the compiled loop, where they are in this process."""

    def __init__(
        self,
        name: str,
        description: Description,
        outputs: Vector,
        starts: Starts = (),
        policy: Faults | None = None,
        folder: str = "",
    ) -> None:
        self.name, self.description, self.outputs = name, description, outputs
        self.starts, self.policy, self.held = starts, policy or Faults(), 0
        self.good: Vector | None = None
        self.place = StepState()
        self._waiting: list[tuple[float, Callable[[float], object]]] = []
        self.recorded_only: frozenset[str] = frozenset()
        self.goes_back = True
        """Whether a state may be restored that is earlier than the newest step."""
        self.log_path = ""
        """The file to which it writes what the FMU logs, "" for none."""
        self.row_due = ctypes.c_int64(1)
        self._counted = False
        self.bounds = OutputBounds(description, outputs)
        self.converted = factors_and_offsets([s.conversion for s in description.outputs])
        """Of its outputs, where these are in other units than their FMU's."""
        self._folder = folder

    def __enter__(self) -> Instance:
        try:
            self._load()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        fault = self.close()
        if fault and not isinstance(error, Fault | KeyboardInterrupt):
            raise fault

    # --- where it stands ------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Where the instance stands (s), for messages."""
        return float(self.place.time)

    @property
    def ended(self) -> bool:
        """Whether the FMU has requested the end of the simulation; it is only read after that."""
        return bool(self.place.ended)

    @property
    def step_time(self) -> float:
        """Time spent in doStep (s), 0 where the steps are too short to be timed."""
        return float(self.place.step_time)

    @property
    def calls(self) -> dict[str, int]:
        """The number of calls of its functions in the loop, by kind."""
        return self.place.calls() if self._counted else {}

    # --- settings while it runs -----------------------------------------------------------

    def before_step(self, setting: Callable[[float], object], time: float = -math.inf) -> None:
        """Have a function that sets inputs or parameters called before the next step, or the first
        that begins at `time` (s) or later, with the time (s) of that step: FMI allows no output to
        be read between such a call and a step (FMI 2.0.5 section 4.2.4)."""
        self._waiting.append((time, setting))
        self.place.waiting = min(self.place.waiting, time)

    def settle(self, time: float) -> None:
        """Call what waits for the step that begins now, at `time` (s)."""
        ready = [setting for due, setting in self._waiting if due <= time]
        self._waiting = [(due, setting) for due, setting in self._waiting if due > time]
        self.place.waiting = min((due for due, _ in self._waiting), default=math.inf)
        for setting in ready:
            setting(time)

    def due_time(self, setting: Callable[[float], object]) -> float | None:
        """From when on (s) a setting waits for a step; None where it does not wait."""
        return next((due for due, waiting in self._waiting if waiting is setting), None)

    def forget_settings(self) -> None:
        """Nothing waits for a step any more."""
        self._waiting.clear()
        self.place.waiting = math.inf

    # --- hardware -------------------------------------------------------------------------

    def begin(self) -> None:  # noqa: B027
        """Everything else is ready to run."""

    def rest(self) -> None:  # noqa: B027
        """The run has ended, however: hardware is left without torque before anything else."""

    # --- what each kind does in its way, every call of which may raise FmuFault -----------

    @abstractmethod
    def _load(self) -> None:
        """Load and instantiate."""

    @abstractmethod
    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        """A function that sets `scalars` to the values at the indices `places` of a signal
        vector."""

    def jacobian(self, outputs: Sequence[Scalar], inputs: Sequence[Scalar]) -> Matrix | None:
        """The Jacobian (outputs, inputs) at the current state, by directional derivatives; None if
        the FMU does not provide them."""
        return None

    @abstractmethod
    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        """Tell the start and stop times (s) and the tolerance of the description, set the start
        values, and enter initialisation mode."""

    @abstractmethod
    def exit_initialization(self) -> None:
        """Leave initialisation mode, enter step mode, and read all outputs again: an FMU may
        compute them in this call."""

    @abstractmethod
    def read(self) -> None:
        """Read all outputs without checking that they are finite."""

    @abstractmethod
    def read_some(self, places: Sequence[int]) -> None:
        """Read the outputs at these indices, whole arrays of FMI 3.0, and others only where they
        come with them."""

    @abstractmethod
    def step(self, time: float, end: float, size: float) -> None:
        """Begin a doStep from `time` over `size`, to `end` (s)."""

    def finish(self) -> None:  # noqa: B027
        """Wait until the step has been taken, where `step` has only begun it."""

    @abstractmethod
    def save(self, slot: int = 0) -> None:
        """Save the FMU state in a slot, replacing the one in it."""

    @abstractmethod
    def rollback(self, slot: int = 0) -> None:
        """Restore the FMU state of a slot."""

    @abstractmethod
    def serialized(self) -> bytes:
        """The FMU state in bytes (fmi2SerializeFMUstate)."""

    @abstractmethod
    def deserialize(self, state: bytes) -> None:
        """Restore an FMU state from bytes that `serialized` gave, or that were made of them."""

    def dismiss(self) -> None:  # noqa: B027
        """Start closing without waiting for it, where it takes long."""

    def abandon(self) -> None:  # noqa: B027
        """The instance is in a call that does not return: it is not called again."""

    def close(self) -> FmuFault | None:
        """Terminate if FMI allows it in the current state, free, unload, and remove the folder.
        Returns the fault of an FMU that fails in this."""
        return None

    def _convert(self, places: Sequence[int] | slice = slice(None)) -> None:
        """Convert outputs that were just read."""
        if self.converted is not None:
            factors, offsets = (each[places] for each in self.converted)
            self.outputs[places] = factors * self.outputs[places] + offsets

    def _logged(self) -> Sequence[str]:
        """The last messages that the FMU logged."""
        return ()

    # --- outputs --------------------------------------------------------------------------

    def get(self) -> None:
        """Read all outputs. Raises FmuFault for the first that is not finite, unless `faults.nan`
        holds its last value, and Diverged for the first beyond its bound."""
        self.read()
        if not self.bounds.hold():
            self.judge()
        elif self.good is not None:
            self.good[:] = self.outputs

    def judge(self) -> None:
        """What `get` does with outputs that are not all finite and within their bounds."""
        if self.good is None:
            self.require_finite()
        else:
            lost = ~np.isfinite(self.outputs)
            self.outputs[lost] = self.good[lost]
            self.held += int(lost.sum())
        if (first := self.bounds.find_diverged()) is not None:
            name, bound = self.description.outputs[first].name, 1.0 / self.bounds.inverse[first]
            beyond = f"output {name} is {self.outputs[first]:.3g}, beyond {bound:.3g}"
            remedy = "take a higher rate, a finer integrator, or weaker gains"
            message = f"{beyond}: the run has diverged ({remedy})"
            raise Diverged(self.name, message, self.time, repeatable=True)
        if self.good is not None:
            self.good[:] = self.outputs

    def require_finite(self) -> None:
        """Raises FmuFault naming the first output that is not finite."""
        if np.isfinite(self.outputs).all():
            return
        for scalar, value in zip(self.description.outputs, self.outputs.tolist(), strict=True):
            if not np.isfinite(value):
                what = f"output {scalar.name} is {value!r}"
                raise self._fault(what, self.time, repeatable=True)

    def _start_loop(self) -> None:
        """Take the start values of the outputs as reference for their bounds, and count calls from
        here."""
        self.bounds.start()
        self.place.start()
        self._counted = True
        if self.policy.nan == "hold":
            self.good = self.outputs.copy()

    def _fault(self, what: str, time: float, repeatable: bool = False) -> FmuFault:
        return FmuFault(self.name, what, time, self._logged(), repeatable)
