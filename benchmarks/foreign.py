"""Foreign FMUs, which packages of PyPI and public repositories bring, by hapticlink and by FMPy:
the largest difference of an output, or why an FMU is not run.

Each FMU runs alone, in `foreign_runs`: at the step of its default experiment, and at the power of
two next to it. Communication points and steps are exact in binary there, so that both tools call
the FMU with the same bits.
"""

from __future__ import annotations

import dataclasses
import math
import shutil
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, get_type_hints

from benchmarks import code_version
from benchmarks.foreign_packages import (
    ForeignFmu,
    find_fmus,
    install_libraries,
)
from benchmarks.foreign_runs import (
    Case,
    Comparison,
    choose_experiment,
    compare,
    has_states,
)
from benchmarks.page import Progress, table
from benchmarks.rows import Rows

KEYS = ("package", "file", "interface", "settings", "rate_hz")
COLUMNS = (*KEYS, "tool", "fmi", "duration_s", *(f.name for f in dataclasses.fields(Comparison)))
FAST: dict[str, dict[str, Any]] = {
    "VanDerPol": {"mu": 1e4},
    "Dahlquist": {"k": 1e5},
    "Mass_Damper": {"damper.d": 1e6},
    "StateSpace": {"A": [[-1e5, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -0.1]]},
    "SpringDamperPendulum1D": {"damper.d": 1e5},
    "emachine_model": {"inductor.L": 1e-6},
    "edrive_mass": {"inertia.J": 1e-9},
}
"""Parameters that give an FMU for model exchange of that name a short time constant, with which it
is run, too."""
TOLERANCES = (1e-7, 1e-9)
"""With which FMUs for model exchange are run besides their own."""
EQUAL = 1e-9
"""Differences relative to an output's largest value that no tolerance explains: rounding."""
EXPLICIT = 3.31
"""The explicit method of Dormand and Prince is stable for steps up to this many times a time
constant (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.2)."""
STIFF = 10
"""A run is stiff where an explicit method needs this many times the steps of CVODE."""
Row = dict[str, str]


def find_all(folder: Path, progress: Progress) -> list[ForeignFmu]:
    """The FMUs of all packages and repositories, each content once."""
    progress("download of the packages", 0, 1)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ".gitignore").write_text("*\n")  # what is in it is no part of the project
    install_libraries(folder / "libraries")
    found = {fmu.path.parent: fmu for fmu in find_fmus(folder)}
    return sorted(found.values(), key=lambda fmu: (fmu.package, fmu.file))


def choose_quick(fmus: list[ForeignFmu]) -> list[ForeignFmu]:
    """The first of each package."""
    return list({fmu.package: fmu for fmu in reversed(fmus)}.values())[::-1]


def measure(rows: Rows, fmus: list[ForeignFmu], libraries: Path, progress: Progress) -> None:
    """The rows of all FMUs, of which those on disk are not made again."""
    for k, fmu in enumerate(fmus):
        rates, duration = choose_experiment(fmu.path)
        for case in _cases(fmu):
            for rate in rates[-1:] if case.tolerance else rates:
                progress(f"{fmu.path.stem} {case.interface} at {rate} Hz", k, len(fmus))
                if (fmu.package, fmu.file, case.interface, case.settings, rate) in rows:
                    continue
                with tempfile.TemporaryDirectory() as room:
                    found = compare(fmu.path, rate, duration, Path(room), libraries, case)
                rows.add(
                    fmu.package, fmu.file, case.interface, case.settings, rate, fmu.tool, fmu.fmi,
                    duration, *dataclasses.astuple(found),
                )  # fmt: skip
                if not found.rows:
                    break  # what is refused at one rate


def _cases(fmu: ForeignFmu) -> Iterator[Case]:
    """The interfaces of an FMU, with values of parameters, and with tolerances."""
    for interface in fmu.interfaces:
        yield Case(interface)
    if "model-exchange" in fmu.interfaces:
        if fmu.path.stem in FAST:
            yield Case("model-exchange", FAST[fmu.path.stem])
        if has_states(fmu.path):
            yield from (Case("model-exchange", tolerance=each) for each in TOLERANCES)


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes runs.csv. Packages are in `out` until all is measured."""
    code_version.begin(out, ("runs.csv",))
    rows, packages = Rows(out / "runs.csv", COLUMNS, keys=len(KEYS)), out / "packages"
    fmus = find_all(packages, progress)
    measure(rows, choose_quick(fmus) if quick else fmus, packages / "libraries", progress)
    shutil.rmtree(packages)
    return page(list(rows.rows.values()), command)


def page(rows: list[Row], command: str) -> str:
    by_fmu: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in rows:
        if not row["settings"].startswith("tolerance"):
            by_fmu[tuple(row[key] for key in KEYS[:-1])].append(row)
    ran = [r for r in by_fmu.values() if _comparison(r[0]).outputs]
    not_run = [r[0] for r in by_fmu.values() if not _comparison(r[0]).outputs]
    compared = [row for fmu in ran for row in fmu]
    exchange = [row for row in compared if row["interface"] == "model-exchange"]
    lines = [
        "# Foreign FMUs beside FMPy",
        "",
        f"{_count(fmu[0] for fmu in ran)} FMUs run in hapticlink and in FMPy. By co-simulation "
        f"{_equal(row for row in compared if row not in exchange)}. {_count(not_run)} others are "
        "not run, or not compared; the second table says why.",
        "",
        f"By model exchange {_count(exchange)} of the FMUs run, "
        f"{_count(row for row in exchange if _comparison(row).events)} of these with events (their "
        f"number is beside the difference), and {_count(filter(_is_stiff, exchange))} "
        f"[stiff](#stiff-fmus): {_equal(exchange)}, but for the last row of an FMU that ends by an "
        "event.",
        "",
        f"Made by `{command}` from FMUs that packages of PyPI and repositories of GitHub bring: "
        f"{_listed(sorted({row['package'] for row in rows}))}. pip checks them by their sha256, "
        "and git by the commit. Files of the same content are listed once. Each FMU runs alone, "
        "from the same start values. Half-way every input that is a scalar number grows by one, "
        "and every Boolean changes, except in FMUs that would end the run (such as a crane whose "
        "rope cannot be set). The rates are that of the default experiment's step (100 Hz "
        "without one) and the power of two next to it, until the experiment's end or 1 s, for at "
        "most 2000 steps. Rows are communication points. All rows: [runs.csv](runs.csv).",
        "",
        *table(
            "FMU | from | made by | FMI | by | rate | rows | outputs | largest difference",
            "lllrlrrrl",
            (cells for fmu in ran for cells in _ran_cells(fmu)),
        ),
        "",
        "Outputs: of an FMU without outputs its continuous states.",
        "",
        *_causes(compared),
        *_stiff_table(exchange),
        *_tolerance_table([*exchange, *rows]),
        "## Not run",
        "",
        "Or not compared. In hapticlink's own words.",
        "",
        *table("FMU | from | made by | FMI | by | why", "lllrll", map(_not_run_cells, not_run)),
        "",
    ]
    return "\n".join(lines)


def _comparison(row: Row) -> Comparison:
    kinds = get_type_hints(Comparison)
    of = {name: kind(row[name]) for name, kind in kinds.items() if kind is not bool}
    return Comparison(equal=row["equal"] == "True", **of)


def _equal(rows: Iterable[Row]) -> str:
    """How many runs are equal at rates that are exact in binary, and the largest difference of
    others relative to the output's largest value."""
    found = [(row, _comparison(row)) for row in rows if _is_exact(row)]
    relative = [_relative_difference(row) for row, c in found if not c.equal]
    others = f", others are within {max(relative):.1g} of its largest" if any(relative) else ""
    equal = sum(c.equal for _, c in found)
    return (
        f"{equal} of {len(found)} runs at rates that are exact in binary have every number of an "
        f"output equal to the last bit{others}"
    )


def _ends_by_event(row: Row) -> bool:
    """Whether an FMU with events differs in its last row alone."""
    found = _comparison(row)
    end = (found.rows - 1) / int(row["rate_hz"])
    return found.events > 0 and found.first == end < float(row["duration_s"])


def _is_exact(row: Row) -> bool:
    """Whether communication points are exact in binary."""
    return math.log2(int(row["rate_hz"])).is_integer()


def _explicit_steps(row: Row) -> float:
    """Of an explicit method that remains stable over the run."""
    return _comparison(row).fastest * float(row["duration_s"]) / EXPLICIT


def _is_stiff(row: Row) -> bool:
    return _explicit_steps(row) >= STIFF * max(_comparison(row).steps, 1)


def _stiff_table(exchange: list[Row]) -> Iterator[str]:
    yield from (
        "## Stiff FMUs",
        "",
        f"An FMU counts as stiff where an explicit method needs at least {STIFF} times the steps "
        "that CVODE took. The fastest decay is that of its equations at the end of the run, by "
        "differences: the largest -Re of an eigenvalue. The method of Dormand and Prince is stable "
        f"for steps up to {EXPLICIT} of its time constants.",
        "",
    )
    stiff = [row for row in exchange if _is_stiff(row)]
    cells = [
        (*_about(row)[:2], row["fmi"], row["settings"] or "its own", f"{row['rate_hz']} Hz",
         f"{_comparison(row).fastest:.2g} 1/s", f"{_explicit_steps(row):.2g}",
         str(_comparison(row).steps))
        for row in stiff
    ]  # fmt: skip
    names = "FMU | from | FMI | parameters | rate | fastest decay | explicit steps | CVODE's steps"
    yield from (*table(names, "llrlrrrr", cells), "")


def _tolerance_table(rows: list[Row]) -> Iterator[str]:
    """The differences of FMUs that differ by more than rounding, by tolerance, at one rate."""
    found: dict[tuple[str, ...], dict[str, Row]] = defaultdict(dict)
    for row in rows:
        if row["interface"] == "model-exchange":
            of = tuple(row[key] for key in ("package", "file", "rate_hz"))
            found[of][row["settings"]] = row
    names = ["", *(Case(tolerance=each).settings for each in TOLERANCES)]
    whole = [
        by
        for by in found.values()
        if all(name in by for name in names) and _relative_difference(by[""]) > EQUAL
    ]
    yield from (
        "## By tolerance",
        "",
        f"FMUs for model exchange that differ by more than {EQUAL:g}, with tighter tolerances in "
        "both tools: the difference of the output that differs most, relative to its largest "
        "value.",
        "",
    )
    cells = (
        (*_about(by[""])[:2], by[""]["fmi"], f"{by['']['rate_hz']} Hz",
         *(f"{_relative_difference(by[name]):.1e}" for name in names))
        for by in whole
    )  # fmt: skip
    heads = " | ".join(f"{each:g}" for each in TOLERANCES)
    yield from (*table(f"FMU | from | FMI | rate | its own | {heads}", "llrrrrr", cells), "")


def _relative_difference(row: Row) -> float:
    found = _comparison(row)
    same = found.equal or not found.outputs or _ends_by_event(row)
    return 0.0 if same else found.difference / found.scale


def _listed(names: list[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)


def _name(row: Row) -> str:
    return row["file"].rpartition("/")[2].removesuffix(".fmu")


def _ran_cells(fmu: list[Row]) -> Iterator[tuple[str, ...]]:
    for k, row in enumerate(fmu):
        about = _about(row) if k == 0 else ("",) * 5
        found = _comparison(row)
        text = (
            "0, every bit equal" if found.equal else f"{found.difference:.2g} in `{found.output}`"
        )
        if not found.equal:
            text += f" (largest {found.scale:.3g})"
        if row["interface"] == "model-exchange":
            text += f"; {found.events} events"
        if found.inputs == "untouched":
            text += "; inputs untouched"
        if found.hapticlink:
            text += f"; {found.hapticlink}"
        yield *about, f"{row['rate_hz']} Hz", str(found.rows), str(found.outputs), text


def _not_run_cells(row: Row) -> tuple[str, ...]:
    found = _comparison(row)
    why = found.hapticlink
    if found.rows and found.fmpy:
        why = f"hapticlink runs it ({found.rows} rows), FMPy does not: {found.fmpy}"
    elif found.rows and not found.outputs:
        why = f"both run it ({found.rows} rows); it has no output and no state to compare"
    return *_about(row), why.replace("|", "\\|")


def _count(rows: Iterable[Row]) -> int:
    """The number of FMUs."""
    return len({(row["package"], row["file"]) for row in rows})


def _about(row: Row) -> tuple[str, ...]:
    by = row["interface"] + f" ({row['settings']})" * bool(row["settings"])
    return _name(row), row["package"], row["tool"], row["fmi"], by


def _causes(compared: list[Row]) -> Iterator[str]:
    """Why runs differ: rounding of communication points, where they are not exact in binary, the
    mode in which FMPy sets inputs, and steps of the solver for model exchange."""
    unequal = [row for row in compared if not _comparison(row).equal]
    differ = [row for row in unequal if row["interface"] != "model-exchange"]
    exact = [row for row in differ if _is_exact(row)]
    files = {row["file"] for row in exact}
    if inexact := [row for row in differ if row["file"] not in files]:
        names = _listed(sorted({f"{_name(row)}" for row in inexact}))
        first = min(_comparison(row).first for row in inexact)
        yield (
            f"**Differences of {names}** come from rounded communication points: k/100 s, "
            "say, is no binary number. hapticlink gives each step the size h, and the "
            "nearest number to k h to begin at. FMPy gives the difference of two rounded times: "
            f"6 h - 5 h is not h, which may also move a jump by a step. They begin at {first:g} s "
            "or later and disappear at the power of two next to the rate, where both call the FMU "
            "with the same bits."
        )
        yield ""
    if exact:
        yield (
            f"**{_listed(sorted({_name(row) for row in exact}))}** differ at any rate once their "
            "inputs have changed. They declare event mode, in which FMPy sets continuous inputs, "
            "too; hapticlink sets these in step mode "
            "([which is nearer](../../docs/foreign-fmus.md#inputs-in-event-mode))."
        )
        yield ""
    exchange = [row for row in unequal if row["interface"] == "model-exchange"]
    if told := {row["fmi"] for row in exchange if not _ends_by_event(row)} & {"2.0"}:
        yield (
            f"**By model exchange** both integrate by CVODE with the same settings. FMUs of FMI "
            f"{told.pop()} that do not set `completedIntegratorStepNotNeeded` are told of each "
            "step by hapticlink, whose steps therefore end at communication points, and of "
            "communication points alone by FMPy: two results within the solver's tolerance, which "
            "[approach each other](#by-tolerance) as it is tightened. So do those with time "
            "events, before which the solver stops here and is interpolated in FMPy, and those "
            "with event indicators whose inputs change, which is an event here. Others differ by "
            "rounded communication points only."
        )
        yield ""
    if ended := sorted({_name(row) for row in exchange if _ends_by_event(row)}):
        yield (
            f"**The last row of {_listed(ended)}** is at an event by which the FMU ends the run: "
            "FMPy keeps the values before it, hapticlink those behind it."
        )
        yield ""
