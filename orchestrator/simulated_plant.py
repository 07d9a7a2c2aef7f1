"""The process of a simulated board: its firmware on a pseudo-terminal, with the device and the hand
of a scene, which go on with the clock of this computer.

    python -m hapticlink.orchestrator.simulated_plant SCENE.json LOG WATCHDOG

It prints the name of its terminal, and ends when its standard input does. Until a run begins the
hand keeps the device where the scene starts. LOG gets a row for each change of torques: the time
(s, of the monotonic clock) and the torques (N.m) of the connectors. WATCHDOG is 1 or 0.
"""

from __future__ import annotations

import gc
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from hapticlink.components.specs.driver import Driver
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.base.signal_names import (
    DEVICE,
    HAND,
    MOTOR_ANGLES,
    MOTOR_MAP,
    MOTOR_TORQUES,
)
from hapticlink.orchestrator.base.temporary_folders import temporary_folder
from hapticlink.orchestrator.boards.driver import SIMULATED_BOARD, Wiring
from hapticlink.orchestrator.boards.simulated_board import CONNECTORS, Firmware
from hapticlink.orchestrator.fmi.worker_process import OWN_GROUP
from hapticlink.orchestrator.run.initialize import initialize
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.real_time_priority import raise_priority
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_source import Source
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.orchestrator.system.system import System

RATE = 1000
"""Steps a second of the device and the hand."""
BEHIND = 0.5
"""Time (s) that the device may be behind the clock before it loses the rest, as on a busy
machine."""


class SimulatedPlant:
    """The device and the hand of a scene whose FMUs are loaded, at the connectors of the board that
    the scene tells of."""

    def __init__(self, scene: Scene, fmus: LoadedFmus) -> None:
        assert scene.device
        self._fmus, self._values = fmus, fmus.signals.values
        system, values = fmus.system, self._values
        initialize(fmus)
        self._order = [name for name in (DEVICE, HAND) if name in fmus.instances]
        self._setters = {
            name: fmus.setter(incoming, fmus.signals.sources)
            for name in self._order
            if (incoming := system.into(name))
        }
        self._tau, self._q = (
            [fmus.signals.scalar(signal.partition(".")[0], s.name) for s in ports]
            for signal, ports in (
                (MOTOR_TORQUES, system.fmu[MOTOR_MAP].description.port("tau", "output")),
                (MOTOR_ANGLES, system.fmu[DEVICE].description.port("q_true", "output")),
            )
        )
        wiring = Wiring.of(
            scene.device.driver or Driver(), len(self._tau), [1.0] * len(self._q), [0.0]
        )
        self._motors, self._encoders = wiring.motors, wiring.encoders
        self._begun: float | None = None
        self._steps = 0
        values[self._tau] = 0.0

    def advance(self, seconds: float, torques: Sequence[float]) -> Sequence[float]:
        if self._begun is not None:
            due = int((seconds - self._begun) * RATE)
            if due - self._steps > BEHIND * RATE:
                lost = due - self._steps
                self._begun += lost / RATE
                due -= lost
            self._values[self._tau] = [sign * torques[c - 1] for c, sign in self._motors]
            while self._steps < due:
                self._step()
        angles = [0.0] * CONNECTORS
        for (connector, sign), place in zip(self._encoders, self._q, strict=True):
            angles[connector - 1] = sign * float(self._values[place])
        return angles

    def begin(self, seconds: float) -> None:
        """Let the hand go on from this time (s)."""
        if self._begun is None:
            self._begun = seconds

    def _step(self) -> None:
        begin, end = self._steps / RATE, (self._steps + 1) / RATE
        fmus = self._fmus
        for name in self._order:
            instance = fmus.instances[name]
            if set_inputs := self._setters.get(name):
                set_inputs(self._values)
            sampled = fmus.system.fmu[name].sampled
            instance.step(begin, begin if sampled else end, 1 / RATE)
            instance.finish()
            instance.get()
        self._steps += 1


def simulated(tables: dict[str, Any]) -> Scene:
    """The scene with its device simulated, in steps of 1/RATE."""
    tables = json.loads(json.dumps(tables))
    tables["device"].setdefault("driver", {})["port"] = ""
    tables["haptics"]["rate"] = RATE
    tables["duration"] = 2 * tables["duration"] + 60
    tables.pop("stop_when", None)
    tables.pop("at", None)
    return open_scene.load(Source("simulated board", tables, {}))


@contextmanager
def attach(
    scene: Scene, system: System, log: Path = Path(os.devnull), watchdog: bool = True
) -> Iterator[System]:
    """The system, whose device that asks for a simulated board gets the terminal of one that is a
    process within the context. log, watchdog: of the process. Raises InputFault where there can be
    none."""
    asking = [u for u in system.fmus if u.driver and u.driver.port == SIMULATED_BOARD]
    if not asking:
        yield system
        return
    if os.name != "posix":
        raise InputFault(f"{SIMULATED_BOARD}: it needs Linux or macOS")
    if asking != [u for u in system.fmus if u.name == DEVICE]:
        raise InputFault(f"{SIMULATED_BOARD}: it has the first user's device alone")
    with temporary_folder() as folder:
        path = folder / "scene.json"
        path.write_text(json.dumps(scene.tables()))
        command = [sys.executable, "-P", "-m", __spec__.name, str(path), str(log), f"{watchdog:d}"]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **OWN_GROUP
        ) as process:
            try:
                assert process.stdout
                port = process.stdout.readline().strip()
                if not port:
                    raise InputFault(f"{SIMULATED_BOARD}: its process ended before it was ready")
                (fmu,) = asking
                assert fmu.driver
                there = replace(fmu, in_its_place=replace(fmu.driver, port=port))
                yield replace(system, fmus=tuple(there if u is fmu else u for u in system.fmus))
            finally:
                process.kill()


def serve(tables: dict[str, Any], log: Path, watchdog: bool) -> None:
    """Be the board until standard input ends."""
    import tty  # not on Windows

    scene = simulated(tables)
    with ExitStack() as stack:
        system = stack.enter_context(build_system(scene))
        assert scene.device
        plant = SimulatedPlant(scene, LoadedFmus(system, stack))
        board = Firmware(plant, watchdog, scene.device.torque_limit)
        rows = stack.enter_context(log.open("w", buffering=1))
        board_end, host_end = os.openpty()  # which stays open where a host closes it
        tty.setraw(host_end)
        print(os.ttyname(host_end), flush=True)
        told: list[float] = []
        gc.disable()  # nothing below leaves cycles
        stack.enter_context(raise_priority())  # a board has a processor of its own
        while True:
            ready, _, _ = select.select([board_end, 0], [], [], 1 / RATE)
            if 0 in ready and not os.read(0, 1):
                return
            now = time.monotonic()
            if board_end in ready:
                answer = board.take(os.read(board_end, 4096), now)
                if board.messages > 1:  # the first asks where the handle is
                    plant.begin(now)
                os.write(board_end, answer)
            else:
                board.at(now)
            if board.torques != told:
                told = [*board.torques]
                rows.write(f"{now!r},{','.join(map(repr, told))}\n")


if __name__ == "__main__":
    try:
        serve(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]), sys.argv[3] == "1")
    except Fault as fault:  # the device has diverged, or its FMUs have failed
        sys.exit(f"{SIMULATED_BOARD} has ended: {fault}")
