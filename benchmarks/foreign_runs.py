"""An FMU alone, run by hapticlink and by FMPy with the same steps and inputs, each in a process of
its own, which an FMU may end.

    python -m benchmarks.foreign_runs build2/fmus build3/fmus

compares all FMUs of folders: such as those into which CMake has built
github.com/modelica/Reference-FMUs, with -DFMI_VERSION=2 and 3.
"""

from __future__ import annotations

import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description

ROOT = Path(__file__).parent.parent
LONGEST = 300.0
"""Run time (s) after which a run is ended."""
MOST_STEPS = 2000
ROUNDING = 1e-12
"""Times (s) closer than that are one instant."""
NOT_NUMBERS = ("String", "Binary", "Clock")
NUMBERS = ("Real", "Integer", "Boolean", "Float32", "Float64")


@dataclass(frozen=True)
class Comparison:
    """Of the outputs that are numbers, or of the continuous states of an FMU without outputs."""

    rows: int = 0
    outputs: int = 0
    equal: bool = False
    """Whether all are equal to the last bit."""
    difference: float = math.nan
    """The largest, absolute."""
    output: str = ""
    """Which has the largest difference."""
    scale: float = math.nan
    """The largest absolute value of that output."""
    first: float = math.nan
    """The time (s) of the first difference of a bit in any output."""
    hapticlink: str = ""
    """Why it is not run, or how its run ended before its time, in hapticlink's own words."""
    fmpy: str = ""
    """Why FMPy does not run it, in FMPy's words."""
    events: int = 0
    """How often an FMU for model exchange was in event mode."""
    steps: int = 0
    """Of the solver of an FMU for model exchange."""
    fastest: float = 0.0
    """The fastest decay (1/s) of an FMU for model exchange at its end: the largest -Re of an
    eigenvalue of its equations."""
    inputs: str = "none"
    """Whether inputs are "set", "untouched" since the FMU ends a run otherwise, or there are
    "none"."""


@dataclass(frozen=True)
class Case:
    """What is run of an FMU: its interface, values of parameters and inputs, and the tolerance of
    the solver, by default that of its DefaultExperiment."""

    interface: str = "co-simulation"
    start: Mapping[str, Any] = field(default_factory=dict)
    tolerance: float | None = None

    @property
    def settings(self) -> str:
        given = {**self.start, **({"tolerance": self.tolerance} if self.tolerance else {})}
        short = {n: v if isinstance(v, list) else f"{v:g}" for n, v in given.items()}
        return ", ".join(f"{name} = {value}" for name, value in short.items())


def choose_experiment(path: Path) -> tuple[tuple[int, ...], float]:
    """Rates (Hz) and duration (s): the step of the default experiment, or 10 ms, and the power of
    two next to it, whose communication points are exact in binary; until the experiment's end or
    1 s, at most 2000 steps."""
    model = _describe(path)
    experiment = model.defaultExperiment if model else None
    step = float(experiment.stepSize or 0.01) if experiment else 0.01
    end = float(experiment.stopTime or 1.0) if experiment else 1.0
    rate = max(round(1 / step), 1)
    exact = 2 ** round(math.log2(rate))
    whole = max(math.floor(min(end, MOST_STEPS / max(rate, exact))), 1)
    return tuple(dict.fromkeys((rate, exact))), float(whole)


def _describe(path: Path) -> Any:
    """FMPy's description, None where it cannot read it."""
    try:
        return read_model_description(str(path), validate=False)
    except Exception:  # FMPy raises Exception itself
        return None


def find_interfaces(path: Path) -> tuple[str, ...]:
    """Of co-simulation and model exchange those that an FMU has."""
    about = _describe(path)
    has = {
        "co-simulation": about and about.coSimulation,
        "model-exchange": about and about.modelExchange,
    }
    return tuple(kind for kind, element in has.items() if element is not None)


def choose_signals(path: Path) -> list[str]:
    """The outputs that are numbers, or the continuous states of an FMU without any."""
    variables = model.modelVariables if (model := _describe(path)) else ()
    outputs = [v for v in variables if v.causality == "output" and v.type not in NOT_NUMBERS]
    states = (v.derivative for v in variables if v.derivative is not None)
    return list(dict.fromkeys(v.name for v in outputs or states))


def has_states(path: Path) -> bool:
    """Whether it is an FMU for model exchange whose states a solver integrates."""
    model = _describe(path)
    return bool(model and model.modelExchange and model.numberOfContinuousStates)


def choose_inputs(path: Path) -> dict[str, tuple[Any, Any]]:
    """By input that is a scalar number: its start value, and the value from half of the run on, one
    more (the other one of a Boolean), within its declared range."""
    inputs: dict[str, tuple[Any, Any]] = {}
    model = _describe(path)
    for v in model.modelVariables if model else ():
        kind = re.sub(r"^U?Int\d+$", "Integer", v.type)
        if v.causality != "input" or v.dimensions or kind not in NUMBERS:
            continue
        if kind == "Boolean":
            on = str(v.start).lower() in ("true", "1")
            inputs[v.name] = (on, not on)
            continue
        number = int if kind == "Integer" else float
        before = number(v.start or 0)
        inputs[v.name] = (before, min(before + 1, number(v.max)) if v.max else before + 1)
    return inputs


def compare(
    path: Path,
    rate: int,
    duration: float,
    room: Path,
    libraries: Path | None = None,
    case: Case | None = None,
) -> Comparison:
    """Both runs, without setting inputs where the FMU ends a run in which they are set. libraries:
    what Python FMUs import besides. Files are left in `room`."""
    case = case or Case()
    inputs = {name: v for name, v in choose_inputs(path).items() if name not in case.start}
    how = _How(case, choose_signals(path), libraries)
    found = _compare(path, rate, duration, inputs, room / "set", how)
    if inputs and (found.hapticlink or found.fmpy) and (room / "set" / "run").exists():
        untouched = _compare(path, rate, duration, {}, room / "untouched", how)
        if untouched.outputs:
            return replace(untouched, inputs="untouched")
    return found


@dataclass(frozen=True)
class _How:
    case: Case
    signals: list[str]
    libraries: Path | None


def _compare(
    path: Path,
    rate: int,
    duration: float,
    inputs: Mapping[str, tuple[Any, Any]],
    room: Path,
    how: _How,
) -> Comparison:
    room.mkdir()
    at = math.ceil(rate * duration / 2) / rate
    environment = dict(os.environ)
    if how.libraries:
        old = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = os.pathsep.join([str(how.libraries), *([old] if old else [])])
    words = _run_hapticlink(path, rate, duration, inputs, at, room, environment, how)
    table = room / "run" / "haptics.csv"
    ours = _read_table(table) if table.exists() else {}
    if len(ours.get("time", ())) < 2:
        return Comparison(hapticlink=words or "its run has no rows")
    asked = {
        "path": str(path), "rate": rate, "duration": duration, "inputs": inputs, "at": at,
        "out": str(room / "fmpy.npz"), "interface": how.case.interface, "signals": how.signals,
        "start": {
            name: np.ravel(v).tolist() if isinstance(v, list) else v
            for name, v in how.case.start.items()
        },
        "tolerance": how.case.tolerance,
    }  # fmt: skip
    (room / "asked.json").write_text(json.dumps(asked))
    status, text = _call(["benchmarks.foreign_fmpy", str(room / "asked.json")], environment)
    if status:
        text = " ".join(text.split()) or f"status {status}"
        return Comparison(len(ours["time"]), hapticlink=words, fmpy=text)
    with np.load(room / "fmpy.npz") as saved:
        theirs = dict(saved)
    fastest = float(theirs.pop("fastest"))
    found = _compare_tables(ours, theirs, at if inputs else math.inf, words)
    calls = json.loads((room / "run" / "run.json").read_text())["calls"].get("fmu", {})
    return replace(
        found,
        inputs="set" if inputs else "none",
        events=calls.get("events", 0),
        steps=calls.get("solver_steps", 0),
        fastest=fastest,
    )


def _run_hapticlink(
    path: Path,
    rate: int,
    duration: float,
    inputs: Mapping[str, tuple[Any, Any]],
    at: float,
    room: Path,
    environment: Mapping[str, str],
    how: _How,
) -> str:
    """What it says where it does not run the FMU to the end."""
    values = {n: v for n, (v, _) in inputs.items()} | dict(how.case.start)
    start = ", ".join(f"{json.dumps(n)} = {json.dumps(v)}" for n, v in values.items())
    then = ", ".join(f"{json.dumps(f'fmu.{n}')} = {json.dumps(v)}" for n, (_, v) in inputs.items())
    lines = [
        f"title = {json.dumps(path.stem)}", f"duration = {duration}", f"haptics.rate = {rate}",
        "[[fmu]]", 'name = "fmu"', f"path = {json.dumps(str(path))}",
    ]  # fmt: skip
    if how.signals:
        signals = json.dumps([f"fmu.{name}" for name in how.signals])
        lines.insert(3, f"record.signals = {signals}")
    if how.case.interface == "model-exchange":
        lines.append(f"interface = {json.dumps(how.case.interface)}")
    if how.case.tolerance:
        lines.append(f"tolerance = {how.case.tolerance}")
    if values:
        lines.append(f"start = {{ {start} }}")
    if inputs:
        lines += ["[[at]]", f"time = {at!r}", f"set = {{ {then} }}"]
    scene = room / "scene.toml"
    scene.write_text("\n".join(lines) + "\n")
    command = ["hapticlink", "run", str(scene), "--out", str(room / "run"), "--no-figures"]
    status, text = _call(command, environment)
    if not status:
        return ""
    text = text.replace(f"{path}: ", "")
    found = re.search(r"line \d+: .*?: (.*?)(?=\n +line \d+: |$)", text, re.DOTALL)
    words = found[1] if found else text.partition("hapticlink: ")[2] or f"status {status}"
    return " ".join(words.replace(str(path), path.name).removeprefix("fmu: ").split())


def _call(module: list[str], environment: Mapping[str, str]) -> tuple[int, str]:
    """Status and standard error of a module in a new Python."""
    try:
        ended = subprocess.run(
            [sys.executable, "-m", *module], cwd=ROOT, env=dict(environment), text=True,
            errors="replace", capture_output=True, timeout=LONGEST, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return -1, f"hapticlink: its run takes longer than {LONGEST:g} s"
    return ended.returncode, ended.stderr.strip()


def _read_table(path: Path) -> dict[str, np.ndarray]:
    """By output. Texts are left out."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    columns = zip(head, zip(*rows, strict=True), strict=True) if rows else ()
    table = {}
    for name, values in columns:
        try:
            table[name.removeprefix("fmu.")] = np.array([float(v) for v in values])
        except ValueError:
            continue
    return table


def _compare_tables(
    ours: Mapping[str, np.ndarray], theirs: Mapping[str, np.ndarray], at: float, words: str
) -> Comparison:
    """At our times. FMPy has a row before and after each event: the last of an instant is what
    holds from there, but for the instant `at` (s), where our row stands before inputs change."""
    time = ours["time"]
    rows = np.searchsorted(theirs["time"], time + ROUNDING, side="right") - 1
    if at in time:
        rows[time == at] = np.searchsorted(theirs["time"], at - ROUNDING)
    if (late := np.abs(theirs["time"][rows] - time).max()) > 1e-9:
        return Comparison(len(time), hapticlink=words, fmpy=f"its rows end {late:g} s earlier")
    largest, first, outputs = (0.0, "", math.nan), math.inf, 0
    for name, a in ours.items():
        if name == "time" or name not in theirs:
            continue
        outputs += 1
        b = theirs[name][rows]
        if (unequal := a.view(np.int64) != b.view(np.int64)).any():
            first = min(first, float(time[unequal][0]))
            apart = float(np.nan_to_num(np.abs(a - b), nan=math.inf)[unequal].max())
            largest = max(largest, (apart, name, float(np.abs(b).max())), key=lambda x: x[0])
    equal = math.isinf(first)
    return Comparison(
        len(time), outputs, equal, *largest, math.nan if equal else first, hapticlink=words
    )


def main(folders: list[str]) -> None:
    for folder in folders:
        for path in sorted(Path(folder).absolute().glob("*.fmu")):
            rates, duration = choose_experiment(path)
            for kind, rate in product(find_interfaces(path), rates):
                with tempfile.TemporaryDirectory() as room:
                    found = compare(path, rate, duration, Path(room), case=Case(kind))
                    print(path.name, kind, rate, found, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
