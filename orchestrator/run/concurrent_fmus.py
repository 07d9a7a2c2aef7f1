"""FMUs that run beside the haptic loop in real time, as on the graphics computer of the report.

The steps of plants at other rates than the haptic one are taken in a thread, one for each clock,
while the haptic loop goes on. Their outputs are samples with the stamp t of the step's end. Samples
that arrive in time act exactly as they would without real-time pacing. Others are late: the haptic
loop reads them at its first event after the step has ended, and holds receive them with the stamp t
and that arrival time. The next step begins at that event, with the inputs known by then, and takes
the FMU from t to the clock's first communication point that is not past, or, if its step size is
fixed, to the next one.
"""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread
from typing import Protocol

from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.plan.operations import Event, Firing, OfFmu, Step
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run import real_time_priority
from hapticlink.orchestrator.run.compiled import structures

GRACE = 2.0
"""Time (s) that a step gets to end when the run ends."""
COLUMNS = ("arrival", "lateness", "computing")
"""Of the table of samples, beside their stamp, in s."""
SAMPLES = "samples"
"""The table of a clock's samples is <clock>_samples.csv."""
Job = Callable[[], object]


class Worker(Protocol):
    """Carries out jobs one after the other."""

    def submit(self, job: Job, done: Job) -> None:
        """Call `job`, then `done`."""

    def close(self, seconds: float) -> bool:
        """End; whether all jobs have ended within that time."""


class ThreadWorker:
    """A thread that carries out jobs."""

    def __init__(self) -> None:
        self._jobs: SimpleQueue[tuple[Job, Job] | None] = SimpleQueue()
        self._thread = Thread(target=self._work, name="hapticlink-beside", daemon=True)
        self._thread.start()

    def submit(self, job: Job, done: Job) -> None:
        self._jobs.put((job, done))

    def _work(self) -> None:
        real_time_priority.raise_beside()
        while calls := self._jobs.get():
            for call in calls:
                call()

    def close(self, seconds: float) -> bool:
        self._jobs.put(None)
        self._thread.join(seconds)
        return not self._thread.is_alive()


class Side:
    """The FMUs of a clock whose steps are taken beside the loop; longer: whether these may go on to
    the first communication point that is not past. `c` is shared with the compiled loop; clock: ns.
    """

    def __init__(self, longer: bool, clock: Callable[[], int], worker: Worker) -> None:
        self.c = structures.Side(longer=longer)
        self._clock, self._worker = clock, worker
        self._error: BaseException | None = None
        self._running: Instance | None = None
        self._begun = self._computing = 0
        self.samples = self.late = 0
        self.latest = 0.0

    @property
    def busy(self) -> bool:
        return bool(self.c.started != self.c.done)

    def start(self, instance: Instance, step: Job) -> None:
        """Begin a step of an FMU, after those that were begun before."""

        def job() -> None:
            self._running = instance
            try:
                if self._error is None:
                    step()
                    instance.finish()
            except BaseException as error:
                self._error = error

        def done() -> None:
            self._computing = self._clock() - self._begun
            self._running = None
            self.c.done += 1

        if not self.busy:
            self._begun = self._clock()
        self.c.started += 1
        self._worker.submit(job, done)

    def collect(self, lateness: float) -> float:
        """Count the sample of the steps, which are done, and is late by that (s); returns how long
        they have taken (s). Raises what they have raised."""
        if self._error is not None:
            raise self._error
        self.samples += 1
        self.late += lateness > 0
        self.latest = max(self.latest, lateness)
        return self._computing * 1e-9

    def require(self, seconds: float) -> None:
        """Raises FmuFault for a step that has not ended within a time."""
        running = self._running
        if running is not None and self.busy and self._clock() - self._begun > 1e9 * seconds:
            what = f"has not returned from its step within {seconds:g} s (faults.timeout)"
            raise FmuFault(running.name, what, running.time)

    def close(self) -> str:
        """End the thread; the name of an FMU that has not returned from its step, which cannot be
        unloaded then, or "" ."""
        if self._worker.close(GRACE):
            return ""
        hung = self._running
        if hung is None:
            return ""
        hung.abandon()
        self._worker.close(GRACE)
        return hung.name


def find_concurrent(plan: Plan) -> tuple[dict[str, str], dict[str, str]]:
    """The FMUs whose steps can be taken beside the haptic loop, with their clocks, and those of
    other clocks than the haptic one that cannot, with the reason."""
    system, able, unable = plan.system, {}, {}
    for clock in system.timeline.clocks[1:]:
        block = plan.block(Event(False, (Firing(clock.name, clock.longest, False),)))
        for fmu in (u for u in system.fmus if u.clock == clock.name):
            own = [op for op in block if isinstance(op, OfFmu) and op.fmu == fmu.name]
            steps = [op for op in own if isinstance(op, Step)]
            if system.coupling.scheme == "iterated":
                unable[fmu.name] = "its steps may be repeated"
            elif fmu.sampled or own[-1:] != steps:
                unable[fmu.name] = "its outputs are due within the instant"
            else:
                able[fmu.name] = clock.name
    return able, unable


def require_concurrent(plan: Plan) -> dict[str, str]:
    """The FMUs whose steps can be taken beside the haptic loop, with their clocks. Raises
    InputFault where one that cannot is on another computer: the loop would wait for it."""
    able, unable = find_concurrent(plan)
    for fmu in plan.system.fmus:
        if fmu.served and fmu.name not in able:
            why = unable.get(fmu.name, "it is at the haptic rate")
            raise InputFault(f"{fmu.name} cannot be remote in real time: {why}")
    return able
