"""Several runs at once into one folder, and some of them killed: whatever the instants, each ends
with status 0 and its results, is refused at once, or was killed; and what stands in the folder in
the end is one whole run."""

from __future__ import annotations

import json
import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from fuzz.cases import Made, seeded
from fuzz.processes import Process, own_folder
from hapticlink.orchestrator.results import read_results

SCENES = ("pendulum", "closed-loop-ideal", "four-bar")
REFUSED = "another run writes there"


def _case(out: Path, draw: random.Random, kills: bool) -> tuple[str, str]:
    begin = time.monotonic()
    count = draw.choice((2, 3, 4))
    starts = sorted(draw.uniform(0.0, 2.0) for _ in range(count))
    processes: list[tuple[str, Process]] = []
    for start in starts:
        time.sleep(max(0.0, begin + start - time.monotonic()))
        scene = draw.choice(SCENES)
        arguments = ["run", scene, "--set", "duration=0.5", "--out", str(out)]
        processes.append((scene, Process(arguments, out.parent, {}, stdout=False)))
    if kills:
        time.sleep(draw.uniform(0.0, 2.0))
        processes[draw.randrange(count)][1].signal(signal.SIGKILL, group=False)
    regular = []
    for scene, process in processes:
        status, said = process.ended()
        if status is None:
            return "hung", scene
        if status == 0:
            regular.append(scene)
        elif status == 2 and REFUSED in said and "Traceback" not in said:
            pass
        elif not (kills and status == -signal.SIGKILL):
            return "crashed", f"status {status}: {said[-400:]}"
    return _whole(out, regular, kills)


def _whole(out: Path, regular: list[str], kills: bool) -> tuple[str, str]:
    """What stands in the folder; `regular`: the scenes of the runs that ended with status 0."""
    if not regular and not kills:
        return "lost", "no run ended with status 0"
    if not (out / "run.json").exists():
        return ("told", "") if kills and not regular else ("lost", "no run.json")
    story = json.loads((out / "run.json").read_text("utf-8"))
    if story["end"]["reason"] == "running":  # killed: what is there is recovered
        status, said = Process(["recover", str(out)], out.parent, {}).ended()
        return ("lost", f"not recovered: {said[-300:]}") if status else ("told", "")
    there, listed = {p.name for p in out.iterdir()}, set(story["files"])
    if there != listed and not kills:
        return "lost", f"run.json lists other files: {', '.join(sorted(there ^ listed))}"
    if read_results.load(out).haptics["time"][-1] != story["end"]["time"]:
        return "lost", "run.json says another end than the rows"
    return "done", ""


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` folders, every third with a run that is killed."""
    for i, case, draw in seeded(number, seed):
        kills = i % 3 == 2
        with own_folder() as folder:
            ended = _case(folder / "out", draw, kills)
        yield Made("at once, one killed" if kills else "at once", case, *ended)
