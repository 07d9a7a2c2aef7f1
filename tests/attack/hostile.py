"""FMUs that behave badly on purpose: of FMI 2.0 and FMI 3.0, in C and in Python (pythonfmu,
pythonfmu3), in the process of the run or in one of their own. `hapticlink run` of a
scene with such an FMU and one that behaves well, which gives to it.

Whatever the FMU does: the command ends with status 1 and a message, or with 0 and a regular end; in
both cases run.json and the tables say the same, and no file and no process stays behind. An FMU in
the process of the run may crash it; then the rows are there nevertheless, and run.json names a
crash. Where it hangs the process of the run, two signals end that. And nothing is believed that is
wrong: a status that FMI does not define never counts as success, and the other FMU's numbers are
those of a run without a hostile FMU. _exit(0) of code in the process of the run, which nobody is
asked about, and a process that it forks there are left out.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from hapticlink.orchestrator.results import read_results
from tests.attack.cases import WITH_BELIEVED, Made, seeded
from tests.attack.processes import PATIENCE, Room, own_folder
from tests.orchestrator import hostile_slave
from tests.orchestrator.c_fmus import hostile_fmu
from tests.orchestrator.foreign_scenes import hostile_scene

PLACES = ("make", "enter", "leave", "set", "get", "step", "save", "restore", "end", "free")
STATUSES = (
    *("warning", "discard", "error", "fatal", "pending"),
    *("minus", "least", "most", "thirtytwo"),
)
ENDS_THE_RUN = ("finish", "middle", "never", "beyond")
"""Requests to end the simulation: at the end of a step, within it, at NaN, at 1e300 s."""
ACTS = (
    *STATUSES,
    *("nan", "inf", "huge", "root", "gone", "upward", "zero", "flush"),
    *("exit", "exit3", "leave", "abort", "null", "stack", "loop", "sleep", "slow"),
    *("stdout", "stderr", "stdin", "deaf", "locale"),
    *("prints", "nothing", "format", "long", "bytes"),
    *("thread", "child", "term", "int", "umask", "environ"),
    *("traps", "alarm", "default", "memory", "outside", "early", *ENDS_THE_RUN),
)
CUT_SHORT = {("step", "early"), ("step", "middle"), ("step", "never")}
PACKED = {"C": ACTS, "Python": tuple(hostile_slave.ACTS)}
FILES = {"C": "hostile", "Python": "Hostile{fmi}"}
ENDS_THE_PROCESS = (
    "exit", "exit3", "leave", "abort", "null", "stack", "thread", "queue", "alarm", "default",
    "memory",
)  # fmt: skip
"""thread: where it outlives the library that it runs; queue: pythonfmu's libraries read the fields
of what is no message."""
NEVER_RETURNS = ("loop", "sleep")
BEFORE_SIGNALS = 6.0
"""Seconds after which a run that an FMU may hang is interrupted, and twice that a second time."""
ROWS = 33


class Attack(Room):
    """Cases in a folder of their own."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, LOCPATH=str(folder))
        self.out = folder / "out"
        for fmi in ("2", "3"):
            (folder / fmi).mkdir()
            hostile_fmu(folder / fmi, fmi)
            hostile_slave.hostile_slave(folder / fmi, fmi)
        locale = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
        with suppress(FileNotFoundError):  # where it is not, the act `locale` changes nothing
            subprocess.run(locale, check=False, capture_output=True)
        good = hostile_scene(folder / "2", "good_none_0")
        status, said = self._ended(good, "compiled", PATIENCE)
        assert status == 0, said
        table = read_results.load(self.out).haptics
        self._source = [table[f"source.{port}"].tolist() for port in ("y", "slope")]

    def made(
        self, fmi: str, packed: str, place: str, act: str, step: int, keys: str
    ) -> tuple[str, str]:
        """One of OUTCOMES, and what was wrong."""
        isolated = "isolate" in keys
        name = f"{place}_{act}_{step}"
        file = FILES[packed].format(fmi=fmi)
        scene = hostile_scene(self.folder / fmi, name, keys, file)
        hangs = act in NEVER_RETURNS and not isolated
        status, said = self._ended(scene, BEFORE_SIGNALS if hangs else PATIENCE)
        if status is None:
            return "hung", said[-300:]
        crash = not isolated and act in ENDS_THE_PROCESS
        if not crash and (status not in (0, 1) or "Traceback" in said or "Fatal Python" in said):
            return "crashed", f"status {status}: {said[-400:]}"
        if act == "exit" and crash and status == 0:
            return "believed", "exit(0) of an FMU was a success"
        if wrong := [*self._untrue(status, said, crash), *self.left(15.0), *self.hidden(self.out)]:
            return "lost", f"status {status}: {'; '.join(wrong)}: {said[-300:]}"
        if wrong := [*self._believed(fmi, packed, place, act, status)]:
            return "believed", f"status {status}: {'; '.join(wrong)}: {said[-300:]}"
        return "done" if status == 0 else "told", ""

    def _ended(self, scene: Path, patience: float) -> tuple[int | None, str]:
        """Status and what was said; after `patience` (s) a signal, later another, then None."""
        shutil.rmtree(self.out, ignore_errors=True)
        arguments = ["run", str(scene), "--out", str(self.out), "--no-figures"]
        arguments += ["--set", "faults.timeout=3"]
        return self.started(arguments).ended(patience, interrupts=2)

    def _untrue(self, status: int, said: str, crash: bool) -> Iterator[str]:
        story = self.out / "run.json"
        if not story.exists():
            if status == 0:
                yield "status 0 without run.json"
            return
        until = time.monotonic() + 20.0
        while True:  # the watchdog may still be at work
            run = json.loads(story.read_text("utf-8"))
            if not crash or run["end"]["reason"] != "running" or time.monotonic() > until:
                break
            time.sleep(0.05)
        if run["end"]["reason"] == "running":
            yield "run.json has no end"
            return
        # By an FMU that has closed the output, or one that interrupts after the run has ended.
        late = "Bad file descriptor" in said or "not all of its figures" in said
        regular = run["end"]["reason"] in ("duration", "terminated")
        if (status == 0) != regular and not crash and not late:
            yield f"run.json says {run['end']['reason']}"
        times = read_results.load(self.out).haptics["time"]
        if len(times) and abs(times[-1] - run["end"]["time"]) > 1e-12:
            yield f"rows until {times[-1]} s, run.json until {run['end']['time']} s"
        if run["end"]["reason"] == "duration" and len(times) != ROWS:
            yield f"{len(times)} rows"

    def _believed(self, fmi: str, packed: str, place: str, act: str, status: int) -> Iterator[str]:
        called = place in ("make", "enter", "leave", "set", "get", "step", "end")
        failed = hostile_slave.RAISES if packed == "Python" else {*STATUSES} - {"warning"}
        if called and act in failed and status == 0:
            yield f"{act} from {place} was a success"
        if not (self.out / "run.json").exists():
            return
        whole = json.loads((self.out / "run.json").read_text())["end"]["reason"] == "duration"
        if (place, act) in CUT_SHORT and (fmi, act) != ("2", "early") and whole:
            yield f"a step that ended {act} was a whole one"
        table = read_results.load(self.out).haptics
        for port, good in zip(("y", "slope"), self._source, strict=True):
            numbers = table[f"source.{port}"].tolist()
            if numbers != good[: len(numbers)]:
                yield f"source.{port} has other numbers"


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` FMUs, by seed."""
    with own_folder() as folder:
        made = Attack(folder)
        for i, _, draw in seeded(number, seed):
            fmi, packed = draw.choice("23"), ("C", "Python")[i % 2]
            act = PACKED[packed][i // 2 % len(PACKED[packed])]
            place = draw.choice((*PLACES, "step", "step", "step"))
            keys = draw.choice(("", "isolate = true"))
            step = draw.randrange(1, 30)
            if act in ("leave", "child"):
                keys = "isolate = true"
            case = (fmi, packed, place, act, step, keys)
            kind = f"FMI {fmi}.0 in {packed}, {'isolated' if keys else 'in process'}"
            yield Made(kind, str(case), *made.made(*case))


OUTCOMES = tuple(outcome for outcome in WITH_BELIEVED if outcome != "refused")
