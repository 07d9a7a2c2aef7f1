"""A board with motors and encoders in the place of the simulated device.

A board answers to torques alone, with the angles that it has when they arrive. So at t_k the
torques of the step before are sent once more and the answer is waited for, some tenths of a
millisecond: outputs are those of t_k, as those of the simulated device are. The torques of t_k
follow as soon as they are computed; their answer, which nobody needs, is read at the next tick.

Torque is zero before anything else happens at the end of a run, at a signal and at a fault: a
torque that is not finite, a jump of an angle, an answer that is missing or makes no sense. A port
is opened when everything else is ready.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import Any

import numpy as np

from hapticlink.components.specs.driver import Driver
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.boards.driver import DRIVERS, DeviceDriver, Silent, Wiring
from hapticlink.orchestrator.boards.safe_torques import SafeTorques
from hapticlink.orchestrator.boards.zero_torque_when_killed import write_if_killed
from hapticlink.orchestrator.fmi.description import VARIABLE_STEP, Description
from hapticlink.orchestrator.fmi.in_process import in_process
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.process_cache import describe_once
from hapticlink.orchestrator.fmi.variables import Scalar

TORQUES, RESOLUTION = "tau", "encoder_resolution"
MEASURED = ("q", "counts", "tau_applied")
"""The input and the parameter, and the outputs, that a board has of a device with its observer
beside it."""
ENDS = ((TORQUES, "input"), ("q", "output"))
"""The ports of which a motor and an encoder each have an entry."""
SENT_AT, READ_AT = "sent_at", "read_at"
"""Further outputs: when the torques were sent that the newest answer belongs to, and when that was
read, by the clock of this computer since the board was opened (s). It was measured between."""
TRIES = 3
"""Times that zero torque is sent: where bytes were lost the board takes the first message as what
is missing of another one, and every part of it as a torque below 1e-30 N.m."""


SHORTEST = 5e-3
"""Time (s) for whose way an encoder is given at least: behind a late answer the next comes soon."""
FAR = 0.1
"""Angle (rad) of an encoder from that of the start, above which a run does not begin."""


def describe_board(description: Description) -> Description:
    """What a board has of a device that is described: inputs, parameters, and outputs that are
    measured. Raises ValueError for a device without them."""
    kept = [s for s in description.scalars if s.causality != "output" or s.port in MEASURED]
    needed = {TORQUES: "input", **dict.fromkeys(MEASURED, "output")}
    if missing := [port for port, of in needed.items() if not description.port(port, of)]:
        raise ValueError(f"it has no {', '.join(missing)}")
    times = (Scalar(name, 0, "Real", "output", "s") for name in (SENT_AT, READ_AT))
    return replace(
        description,
        scalars=(*kept, *times),
        flags=frozenset({VARIABLE_STEP}),
        dependencies={s.name: frozenset() for s in (*kept, *times)},
        initial_dependencies={},
        derivatives={},
        power={},
    )


class Board(Instance):
    """A board in the place of the FMU of a device, which is only asked for its angles at the start.

    table: the device's [device.driver].
    """

    def __init__(self, table: Driver, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._table = table
        outputs = self.description.outputs
        self._places = {
            name: [i for i, s in enumerate(outputs) if s.port == name]
            for name in (*MEASURED, SENT_AT, READ_AT)
        }
        self._inputs = self.description.port(TORQUES, "input")
        self._torques = [0.0] * len(self._inputs)
        self._given: dict[Scalar, float] = {}
        """Parameters that connections set."""
        assert table.torque_limit
        assert table.torque_rate
        self.safe = SafeTorques(table.torque_limit, table.torque_rate, len(self._torques))
        self._driver: DeviceDriver | None = None
        self._sent_at = self._began = self._measured_at = 0.0
        self._applied = self.safe.sent
        self._stepped = self._rests = False
        self._told = False
        """Whether zero torque, when it was sent last, could be written to the port."""
        self._stack = ExitStack()
        self.workers = "normal"
        """The priority of the kernel's workers that pass on the bytes of a serial port."""

    # --- before the run -------------------------------------------------------------------

    def _load(self) -> None:
        """Opens no port: `begin` does, when everything else is ready."""

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        order = {s.name: i for i, s in enumerate(self._inputs)}
        ends = [*zip(scalars, places, strict=True)]

        def take(signals: Vector) -> None:
            for scalar, place in ends:
                conversion = scalar.conversion
                value = float(signals[place]) * conversion.factor + conversion.offset
                if scalar.name in order:
                    self._torques[order[scalar.name]] = value
                else:
                    self._given[scalar] = value

        return take

    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        self._stop_time = stop_time

    def read(self) -> None:
        if self._driver is None:
            self._read_start()
        elif self._stepped:
            self._stepped = False
            self._answer()
            self._send(self._applied)
            self._receive()
        if self._driver and self.place.time >= self._stop_time:
            self.rest()  # before what else there is to wait for at the end of a run

    def _read_start(self) -> None:
        """The outputs of the device's own FMU at the start."""
        about = describe_once(self.description.path)
        starts = tuple({**dict(self.starts), **self._given}.items())
        outputs = np.zeros(len(about.outputs))
        with in_process(about)(self.name, about, outputs, starts, self.policy) as device:
            device.enter_initialization(0.0, 0.0)
            device.exit_initialization()
        values = {s.name: value for s, value in zip(about.outputs, outputs, strict=True)}
        self.outputs[:] = [values.get(s.name, 0.0) for s in self.description.outputs]

    def read_some(self, places: Sequence[int]) -> None:
        self.read()

    def exit_initialization(self) -> None:
        self._start_loop()

    def begin(self) -> None:
        """Open the port and read where the encoders are. Raises FmuFault where the board does not
        answer, or is not where the run starts."""
        starts = self.outputs[self._places["q"]].copy()
        resolution = self._resolution()
        wiring = Wiring.of(self._table, len(self._torques), resolution, starts.tolist())
        self._turns = np.array([math.tau / counts for counts in wiring.counts])
        driver = DRIVERS[self._table.type](self._table.port, wiring)
        try:
            self._open(driver)
            if words := driver.zero_torque_when_killed():
                self.workers = self._stack.enter_context(write_if_killed(*words))
        except (Silent, OSError) as error:
            raise self._fault(f"the board at {self._table.port} {_words(error)}", 0.0) from None
        self._driver = driver
        interrupt.add(self.rest)
        self._stack.callback(interrupt.remove, self.rest)
        self._began = time.perf_counter()
        self._send(self.safe.rest())
        self._receive()
        far = np.abs(self.outputs[self._places["q"]] - starts)
        if far.max(initial=0.0) > FAR:
            i = int(far.argmax())
            raise self._stopped(
                f"encoder {i + 1} is {far[i]:.2g} rad from where the scene starts: move the handle "
                "there, or start the scene at the handle (linkage.start)"
            )

    def _open(self, driver: DeviceDriver) -> None:
        """Open the port until the end of the run; what a driver raises is not hidden by what its
        `close` raises of a port that is half open."""
        try:
            driver.open()
        except Exception:
            with suppress(Exception):
                driver.close()
            raise
        self._stack.callback(driver.close)

    def _resolution(self) -> list[float]:
        """The angle (rad) of a count of each encoder of the device."""
        values = {**{s: s.start for s in self.description.scalars}, **dict(self.starts)}
        given = [float(values[s]) for s in self.description.port(RESOLUTION, "parameter")]
        return given if len(given) == len(self._places["q"]) else given * len(self._places["q"])

    # --- the calls of a run ---------------------------------------------------------------

    def step(self, time: float, end: float, size: float) -> None:
        """Send the torques of this time. Raises Interrupted for a signal that has come."""
        if interrupt.came():
            self.rest()
            interrupt.raise_if_interrupted(time)
        self.place.time = time
        try:
            torques = self.safe.limit(self._torques, size)
        except ValueError as error:
            raise self._stopped(str(error)) from None
        self._send(torques)
        self._stepped = True
        self.place.time = end
        self.place.steps += 1

    def _send(self, torques: Sequence[float]) -> None:
        assert self._driver
        self._sent_at, self._rests = time.perf_counter(), False
        try:
            self._driver.send(torques)
        except OSError as error:
            raise self._stopped(f"the board at {self._table.port} {_words(error)}") from None
        self._applied = [*torques]

    def _answer(self) -> Vector:
        """The counts that the board answers to the oldest message. Raises FmuFault."""
        assert self._driver
        try:
            return np.array(self._driver.receive(self._table.silence))
        except (Silent, OSError) as error:
            raise self._stopped(f"the board at {self._table.port} {_words(error)}") from None

    def _receive(self) -> None:
        """Take over the answer to what was sent last. Raises FmuFault."""
        counts, now = self._answer(), time.perf_counter()
        angles, elapsed = counts * self._turns, now - self._measured_at
        if self._measured_at:
            moved = np.abs(angles - self.outputs[self._places["q"]])
            # A count more: an encoder at rest may be between two.
            most = self._table.speed_limit * max(elapsed, SHORTEST) + self._turns
            if (beyond := moved > most).any():
                i = int(beyond.argmax())
                raise self._stopped(
                    f"encoder {i + 1} has jumped by {moved[i]:.3g} rad in {1e3 * elapsed:.3g} ms "
                    f"(driver.speed_limit is {self._table.speed_limit:g} rad/s)"
                )
        self._measured_at = now
        for name, value in (
            ("q", angles),
            ("counts", counts),
            ("tau_applied", self._applied),
            (SENT_AT, self._sent_at - self._began),
            (READ_AT, now - self._began),
        ):
            if places := self._places[name]:  # it is recorded, or read
                self.outputs[places] = value

    def _stopped(self, what: str) -> FmuFault:
        """The fault, with zero torque, as far as the board can be told."""
        self.rest()
        end = "are zero" if self._told else "may be on: switch the motors off"
        return self._fault(f"{what}: torques {end}", self.time)

    # --- the end --------------------------------------------------------------------------

    def rest(self) -> None:
        if self._driver is None or self._rests:
            return
        self._rests = True
        for _ in range(TRIES):
            try:
                self._driver.send(self.safe.rest())
                self._told = True
            except OSError:
                self._told = False

    dismiss = abandon = rest

    def close(self) -> FmuFault | None:
        self.rest()
        self._driver = None
        self._stack.close()
        return None

    # --- what no hardware does ------------------------------------------------------------

    def save(self, slot: int = 0) -> None:
        raise self._fault("hardware has no state that could be saved", self.time)

    def rollback(self, slot: int = 0) -> None:
        raise self._fault("hardware goes no step back", self.time)

    def serialized(self) -> bytes:
        raise self._fault("hardware has no state that could be saved", self.time)

    def deserialize(self, state: bytes) -> None:
        raise self._fault("hardware goes no step back", self.time)


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, Silent) else f"cannot be reached: {error}"
