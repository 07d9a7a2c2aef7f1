"""What every hold is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext

Vector = NDArray[np.float64]


class Hold(ABC):
    """What stands on an input between two samples of its source. Times are ticks of the base.

    At t = 0 it gets the source's initial output, stamped 0, before it is asked for a value; so it
    does where samples come late. Nothing is known of the time before: until a second sample comes
    that one is all that it can use. Where steps are taken back so is the hold, by a deep copy of
    its attributes: all that it remembers is among them.
    """

    needs: ClassVar[Literal["derivative", "power", "spring"] | None] = None
    """derivative: samples are the signal and then its derivative (1/s of its unit). power: the
    connection carries power, and the context reads the displacement that it works on. spring: the
    connection sets a spring-damper, whose energy is the context's tank."""
    gives_samples: ClassVar[bool] = False
    """Whether every value is one of the samples, unchanged, so that a matrix stays what it is."""
    degree: ClassVar[int] = 0
    """Of the polynomial in time that a value is within a step of the target; 0 where it stands."""
    order: ClassVar[int] = 1
    """Of the error over a run, between plants of one rate; step control goes by it."""
    interpolates: ClassVar[bool] = False
    """Whether it interpolates once it has the sample at the end of the step (`iteration`)."""
    downsamples: ClassVar[bool] = False
    """Whether it may be a scene's `downsampling`, the default from a fast rate to a slow one."""

    @abstractmethod
    def __init__(self, context: HoldContext) -> None:
        """With what is known of the connection; there is no sample yet."""

    @abstractmethod
    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        """Take a sample that is true at `stamp` and known from `arrival` on; stamps never fall, and
        a second sample of one stamp takes the place of the first. `sample` is only valid during
        the call."""

    @abstractmethod
    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        """What the target reads at `tick` for the instant `tick + ahead`, made from samples
        that are known at `tick`. `ahead` is half a step for a plant, which holds its inputs
        over the step, and 0 for a sampled block."""
