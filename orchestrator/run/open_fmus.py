"""Loads the FMUs of a system, by FMI version, in this process or isolated in their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial

from hapticlink.components.specs.driver import Driver
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.boards.board import Board
from hapticlink.orchestrator.boards.replayed_board import RecordedDriver, ReplayedBoard
from hapticlink.orchestrator.fmi.description import NEEDS_TOOL
from hapticlink.orchestrator.fmi.in_process import in_process
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.isolated import Isolated
from hapticlink.orchestrator.fmi.variables import WRITTEN
from hapticlink.orchestrator.network.remote_fmu import Remote
from hapticlink.orchestrator.run.python_modules import clashes, find_bundled
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import Connection, Fmu, InputChange, ServedAt, System


def find_isolated(fmus: Iterable[Fmu]) -> dict[str, str]:
    """The FMUs that run in a process of their own, here or elsewhere, by name, with the reason.
    Raises InputFault for one of which a text is connected or recorded."""
    fmus = tuple(fmus)
    asked = {u.name: "asked for" for u in fmus if u.isolate}
    asked |= {u.name: f"served from {u.served.address}" for u in fmus if u.served}
    tools = {
        u.name: "it needs a tool, which may never answer"
        for u in fmus
        if u.name not in asked
        and NEEDS_TOOL in u.description.flags
        and not find_bundled(u.description.path)  # whose tool is Python, which is there
    }
    alone = asked | tools | clashes(u for u in fmus if u.name not in tools)
    for u in (u for u in fmus if u.name in alone):
        if text := next((s.name for s in u.description.scalars if s.type in WRITTEN), None):
            what = f"{u.name}.{text} is a text, which is read and set within one process"
            why = f"{u.name} runs in another ({alone[u.name]})"
            remedy = "leave it out of [[connection]] and record.signals, or take an array of UInt8"
            raise InputFault(f"{what}; {why}: {remedy}")
    return alone


def refuse_text(change: InputChange, isolated: Mapping[str, str]) -> None:
    """Raises InputFault for a change of a text of an `isolated` FMU."""
    text = next((s.name for s in change.inputs if s.type in WRITTEN), None)
    if text and change.fmu in isolated:
        what = f"{change.fmu}.{text} is a text, which is set within one process"
        why = f"{change.fmu} runs in another ({isolated[change.fmu]})"
        raise InputFault(f"{what}; {why}: set its start value")


def refuse_hardware(fmus: Iterable[Fmu]) -> None:
    """Raises InputFault for FMUs that drive hardware, outside of a run in real time."""
    if hardware := [fmu for fmu in fmus if fmu.hardware]:
        keys = {"device.driver.port" if fmu.driver else "hardware = true" for fmu in hardware}
        what = f"{', '.join(fmu.name for fmu in hardware)}: {', '.join(sorted(keys))}"
        raise InputFault(f"{what}: it is moved by runs in real time alone (--real-time)")


class LoadedFmus:
    """The FMUs of a system, loaded: `instances` by name, each of which fills its outputs among the
    `signals`; `stack` closes them. isolated: as of the function. log_path: the file that what they
    log is written to. goes_back: whether FMUs of others may be asked to restore an earlier state;
    in a run they are where steps are repeated alone. Raises InputFault for one that drives
    hardware, if not `in_real_time`."""

    def __init__(
        self,
        system: System,
        stack: ExitStack,
        log_path: str = "",
        in_real_time: bool = False,
        goes_back: bool = True,
    ) -> None:
        if not in_real_time:
            refuse_hardware(system.fmus)
        self.system, self.signals = system, SignalVector(system)
        self.isolated = find_isolated(u for u in system.fmus if not callable(u.in_its_place))
        self.instances: dict[str, Instance] = {}
        for fmu in system.fmus:
            interrupt.raise_if_interrupted()
            outputs = self.signals.values[self.signals.fmu(fmu.name)]
            opening: Callable[..., Instance]
            match fmu.in_its_place:
                case None if fmu.name in self.isolated:
                    opening = Isolated
                case None:
                    opening = in_process(fmu.description)
                case ServedAt() as at:
                    opening = partial(Remote, at)
                case RecordedDriver() as driver:
                    opening = partial(ReplayedBoard, driver)
                case Driver() as driver:
                    opening = partial(Board, driver)
                case make:
                    opening = make
            instance = opening(fmu.name, fmu.description, outputs, fmu.starts, system.faults)
            instance.recorded_only, instance.log_path = fmu.recorded_only, log_path
            own = fmu.description.block is not None or system.coupling.scheme == "iterated"
            instance.goes_back = goes_back or own
            self.instances[fmu.name] = stack.enter_context(instance)

    def setter(
        self, incoming: Sequence[Connection], places: Callable[[Connection], list[int]]
    ) -> Callable[[Vector], None]:
        """Sets the inputs of an FMU, those of all these connections to it, from the `places` of
        each among the signals."""
        scalars = [s for c in incoming for s in c.inputs]
        at = [p for c in incoming for p in places(c)]
        return self.instances[incoming[0].target].connect(scalars, at)
