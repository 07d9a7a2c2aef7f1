"""An FMU of a run, as the run calls it: `in_process`, or in a process of its own, `isolated`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.faults import Diverged, Fault, FmuFault
from hapticlink.orchestrator.fmi.bounds import Bounds
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.directional_derivatives import Matrix
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.variables import Scalar

if TYPE_CHECKING:  # a worker process need not load what reads scenes
    from hapticlink.orchestrator.fmi.start_values import Starts

Vector = NDArray[np.float64]


class Instance(ABC):
    """A loaded FMU, from instantiation to removal; a context manager, which raises FmuFault where
    the FMU fails in its last call and nothing else has failed.

    `outputs` is the view that `get` fills. `held` counts the outputs that a policy has held at
    their last value. `ended`: the FMU has asked to end the simulation, so it is only read from then
    on.
    """

    ended = False
    time = 0.0
    """Where the instance stands (s), for messages."""

    def __init__(
        self,
        name: str,
        description: Description,
        outputs: Vector,
        starts: Starts = (),
        policy: Faults | None = None,
        folder: str | None = None,
    ) -> None:
        self.name, self.description, self.outputs = name, description, outputs
        self.starts, self.policy, self.held = starts, policy or Faults(), 0
        self._good: Vector | None = None
        self.step_time = 0.0
        self._bounds = Bounds(description, outputs)
        self._folder = folder or temporary_folders.new()

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

    # --- what each kind does in its way, every call of which may raise FmuFault -----------

    @abstractmethod
    def _load(self) -> None:
        """Load and instantiate."""

    @abstractmethod
    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        """A function that takes the values at `places` of a board and sets `scalars` to them."""

    @abstractmethod
    def connect_derivatives(
        self, scalars: Sequence[Scalar], orders: Sequence[int], places: Sequence[int]
    ) -> Callable[[Vector], None]:
        """A function that sets what the scalars have at `places` of a board as their derivatives of
        an order; of order 0, their values, stand first and serve a step that is retried."""

    @abstractmethod
    def jacobian(self, outputs: Sequence[Scalar], inputs: Sequence[Scalar]) -> Matrix | None:
        """(outputs, inputs): the directional derivatives of what the FMU has computed last; None
        where it does not tell them."""

    @abstractmethod
    def enter_initialization(self, stop_time: float) -> None:
        """Set the start values and enter initialisation mode."""

    @abstractmethod
    def exit_initialization(self) -> None:
        """Leave initialisation mode: steps may follow."""

    @abstractmethod
    def read(self) -> None:
        """All outputs, finite or not."""

    @property
    @abstractmethod
    def smaller_steps(self) -> int:
        """How many steps were discarded and taken again in smaller ones."""

    @abstractmethod
    def step(self, time: float, end: float, size: float) -> None:
        """Begin a doStep from `time` over `size`, to `end` (s)."""

    @abstractmethod
    def finish(self) -> None:
        """Wait for the step, where it is not over yet."""

    @abstractmethod
    def save(self, slot: int = 0) -> None:
        """Keep the state in a slot; a slot keeps one."""

    @abstractmethod
    def rollback(self, slot: int = 0) -> None:
        """Go back to the state in a slot, which keeps it."""

    @abstractmethod
    def dismiss(self) -> None:
        """Begin to close, where that takes its time."""

    @abstractmethod
    def close(self) -> FmuFault | None:
        """Terminate where FMI allows it, free, unload, remove the folder; in every state. The fault
        of an FMU that fails in that."""

    def _said(self) -> Sequence[str]:
        """What the FMU logged last."""
        return ()

    # --- outputs --------------------------------------------------------------------------

    def get(self) -> None:
        """All outputs. Raises FmuFault naming the first that is not finite, unless the policy is
        to keep its last value, and Diverged for the first that is beyond its bound."""
        self.read()
        if not self._bounds.kept():
            self._judge()
        if self._good is not None:
            self._good[:] = self.outputs

    def _judge(self) -> None:
        if self._good is None:
            self.require_finite()
        else:
            lost = ~np.isfinite(self.outputs)
            self.outputs[lost] = self._good[lost]
            self.held += int(lost.sum())
        if beyond := self._bounds.first_beyond():
            scalar, value, bound = beyond
            what = f"output {scalar.name} is {value:.3g}, beyond {bound:.3g}: the run has diverged"
            remedy = "take a higher rate, a finer integrator, or weaker gains"
            said = f"{what} ({remedy})"
            raise Diverged(self.name, said, self.time, passing=True, repeatable=True)

    def require_finite(self) -> None:
        """Raises FmuFault naming the first output that is not finite."""
        for scalar, value in zip(self.description.outputs, self.outputs.tolist(), strict=True):
            if not np.isfinite(value):
                what = f"output {scalar.name} is {value!r}"
                raise self._fault(what, self.time, passing=True, repeatable=True)

    def _start_loop(self) -> None:
        """The outputs stand at their start."""
        self._bounds.start()
        if self.policy.nan == "hold":
            self._good = self.outputs.copy()

    def _fault(
        self, what: str, time: float, passing: bool = False, repeatable: bool = False
    ) -> FmuFault:
        return FmuFault(self.name, what, time, self._said(), passing, repeatable)
