"""The base class of the holds of plugins, the contract that every hold fulfils, and what one is
constructed from."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

from hapticlink.orchestrator.base.arrays import Vector

Needs = Literal["derivative", "integral", "gradient", "power"]


@dataclass(frozen=True)
class HoldContext:
    """What a hold is constructed from.

    size: number of entries of the signal. seconds: converts ticks to s. displacement: reads the
    displacement conjugate to the signal, with its sign, so that signal . d(displacement) is the
    work done on the target (J). velocity: reads its time derivative, where the target has it as
    an output.
    """

    size: int
    seconds: Callable[[float], float] = float
    displacement: Callable[[], Vector] | None = None
    velocity: Callable[[], Vector] | None = None


class Hold(ABC):
    """A hold reconstructs the value of an input between two samples of its source.

    1. Times are whole ticks; `HoldContext.seconds` converts them.
    2. At t = 0 the hold receives the source's initial output, which describes 0, before its value
       is read, also where samples are delayed. There is no sample of the time before: until the
       second one arrives, the hold has only that.
    3. `push` takes a sample with the instant that it describes and the instant at which the target
       gets it (its arrival). A plant's outputs describe the end of its step, at which they are
       known; those of a frame block, and samples with a latency, describe an earlier one than that
       of their arrival, those of a step that is taken when it begins a later one. Neither
       decreases.
    4. `value` may be called several times at a tick, for different instants, and returns a vector
       of `HoldContext.size` finite numbers, which the caller does not change.
    5. The whole state of a hold is in its attributes: the lifted map of a scene reads and writes it
       there.

    With a source at a period of 30 ticks, a latency of 15 ticks, and a plant that takes steps of 3:

        hold.push(0, y_0, 0)  # the initial output, which the target knows at once
        hold.push(30, y_1, 45)  # the output of tick 30, which the target knows from tick 45 on
        hold.value(48, 1.5)  # the input at 49.5, the middle of the plant's step from 48 to 51

    where `foh` returns y_1 + (y_1 - y_0) (49.5 - 30)/30.
    """

    needs: ClassVar[Needs | None] = None
    """derivative: a sample is the signal followed by its time derivative (its unit per s).
    integral: by its integral over time, the output of which it is the derivative. power: the
    connection carries power, and the context reads the conjugate displacement."""
    gives_samples: ClassVar[bool] = False
    """Whether every value is one of the samples, unchanged, so that a matrix keeps its kind."""
    degree: ClassVar[int | None] = 0
    """Degree of the value as a polynomial in time within a step of the target; 0 if it is constant,
    None if it varies as no polynomial. Read twice: where it is not 0, `run.json` tells that the
    value varies within a step; and of a row of the table whose `push` keeps samples and nothing
    else and that needs no gradient, a stability analysis takes the value for that polynomial
    between two samples."""
    interpolates: ClassVar[bool] = False
    """Whether it interpolates once the sample of the step's end is known (coupling "iterated")."""
    downsamples: ClassVar[bool] = False
    """Whether a scene may choose it as `downsampling`, the default from a fast to a slow rate."""

    @abstractmethod
    def __init__(self, context: HoldContext) -> None:
        """Construct the hold from what is known of its connection; there is no sample yet."""

    @abstractmethod
    def push(self, described: int, sample: Vector, arrival: int) -> None:
        """Take a sample that describes the instant `described` (tick), and which the target knows
        from `arrival` (tick) on.

        A second sample that describes the same instant replaces the first. `sample` is
        a view that is valid only during the call: copy what is kept.
        """

    @abstractmethod
    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        """The input for the instant `tick + ahead`, read by the target at `tick` and computed from
        the samples known by then.

        `ahead` is in ticks, and may be a fraction of one. For a plant that holds its inputs
        constant over a step it is half the step, for a sampled block 0; in real time it is less by
        what the event comes late, and may be negative.
        """
