"""The report's experiment on two computers with a bad network: error, energy and deadlines.

Server, relay (`network_relay.py`) and run are processes of this machine, on loopback.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple

import hapticlink as hl
from benchmarks.page import Progress, table
from hapticlink.analysis.findings.measures import Measures
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import load
from studies import draw

SCENE, SECONDS, QUICK, SEED = "closed-loop-ideal", 8, 3, 1
NETWORKS: dict[str, tuple[float, float, float, float] | None] = {
    "one computer": None,
    "loopback": (0, 0, 0, -1),
    "5 ms": (0.005, 0, 0, -1),
    "20 +- 5 ms": (0.015, 0.01, 0, -1),
    "20 +- 5 ms, 5 % lost": (0.015, 0.01, 0.05, -1),
    "60 +- 20 ms": (0.04, 0.04, 0, -1),
    "60 +- 20 ms, 5 % lost": (0.04, 0.04, 0.05, -1),
    "5 ms, a cut of 2 s": (0.005, 0, 0, 2),
}
"""Least delay, spread (s) and loss of each way, and when the network is cut (s)."""


class Row(NamedTuple):
    """What became of a run: samples and those late, the largest lateness (ms), frames sent again,
    tracking error (mm), energy (mJ) generated at the port at most, deadlines missed, and whether
    its recorded arrivals give the same bytes."""

    taken: int
    late: int
    lateness: float
    repeated: int
    rms: float
    largest: float
    energy: float
    missed: str
    same: str
    error: Any


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes network.png to `folder`."""
    options = ["packaging=native", f"duration={QUICK if quick else SECONDS}"]
    rows = []
    with temporary_folders.temporary_folder() as room, ExitStack() as stack:
        key, at = room / "key", _free()
        sets = [word for option in options for word in ("--set", option)]
        arguments = ["serve", SCENE, "--listen", at, "--key", str(key), *sets]
        log = room / "serve.log"
        stack.enter_context(_process(["hapticlink", *arguments], log))
        while "serves at" not in log.read_text():
            sleep(0.1)
        for i, (name, network) in enumerate(NETWORKS.items()):
            progress(name, i, len(NETWORKS))
            with ExitStack() as ends:
                remote = {}
                if network:
                    between = _free()
                    *spread, cut = map(str, network)
                    asked = [between, at, str(key), *spread, str(SEED), cut]
                    relay = ["benchmarks.network_relay", *asked]
                    ends.enter_context(_process(relay, room / "relay.log"))
                    remote["graphics"] = between
                rows.append(_row(room / str(i), options, remote, key))
    _figure(folder, rows)
    return "\n".join(_page(rows, options, command))


def _row(out: Path, options: Sequence[str], remote: dict[str, str], key: Path) -> Row:
    run = hl.run(SCENE, options, out=out, figures=False, real_time=True, remote=remote, key=key)
    assert run.fault is None, run.fault
    again = out.with_name(f"{out.name}-again")
    hl.run(SCENE, options, out=again, figures=False, arrivals=out)
    tables = [(f / "haptics.csv", f / "graphics.csv") for f in (out, again)]
    same = all(a.read_bytes() == b.read_bytes() for a, b in zip(*tables, strict=True))
    measures, report = Measures(load(out)), run.run["real_time"]
    samples = report["samples"]["graphics"]
    tracking, port = measures.tracking[""], measures.port
    assert port
    x, y = (run.tables["haptics"][f"{name}"] for name in ("virtual_mechanism.x", "haptic_device.x"))
    error = 1e3 * ((x - y)[:, :2] ** 2).sum(axis=1) ** 0.5
    exchange = run.run["network"].get("virtual_environment", {"repeated": 0})
    return Row(
        samples["taken"], samples["late"], 1e3 * samples["largest_lateness"], exchange["repeated"],
        tracking.rms_mm, tracking.max_mm, 1e3 * port.peak,
        f"{report['deadlines_missed']} of {report['ticks']}", "yes" if same else "no",
        (run.tables["haptics"]["time"], error),
    )  # fmt: skip


def _free() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{probe.getsockname()[1]}"


@contextmanager
def _process(module: Sequence[str], log: Path) -> Iterator[None]:
    with log.open("wb") as file:
        running = subprocess.Popen([sys.executable, "-m", *module], stdout=file, stderr=file)
        try:
            yield
        finally:
            running.terminate()
            running.wait()


def _figure(folder: Path, rows: Sequence[Row]) -> None:
    figure, (axes,) = draw.panels(1, width=8, height=4)
    for i in (0, 3, 5, 7):
        axes.plot(*rows[i].error, label=[*NETWORKS][i], linewidth=0.9)
    axes.set(xlabel="time (s)", ylabel="handle from the operational point (mm)")
    axes.set_ylim(bottom=0)
    figure.legend(loc="outside upper center", ncols=4)
    draw.save(figure, folder, "network.png")


def _page(rows: Sequence[Row], options: Sequence[str], command: str) -> Iterator[str]:
    """The page: the finding, the figure, and a row for each network."""
    one, fast, far = rows[0], rows[2], rows[5]
    same = sum(row.same == "yes" for row in rows)
    yield "# Two computers"
    yield ""
    yield (
        f"With 5 ms each way {fast.late} of {fast.taken} samples are late and the tracking error "
        f"is {short(fast.rms)} mm RMS, {short(one.rms)} on one computer; with 60 +- 20 ms "
        f"{far.late} of {far.taken} are late and it is {short(far.rms)} mm; the recorded arrivals "
        f"of {same} of the {len(rows)} runs give their bytes again."
    )
    yield ""
    yield "![Tracking error over time](network.png)"
    yield ""
    yield (
        f"Made by `{command}`: `{SCENE}` with {', '.join(f'`{o}`' for o in options)} at 512 Hz in "
        "real time, its graphics at 30 Hz in another process, behind a relay that delays and loses "
        "messages of each way by a seed. The energy is what the rendering generated at the user's "
        "port at most; each row is one run, on a machine that did other work beside it. How it "
        "works: [two computers](../../docs/two-computers.md)."
    )
    yield ""
    heads = (
        "each way | samples | late | at most (ms) | sent again | error RMS (mm) | "
        "largest (mm) | energy (mJ) | deadlines missed | same again"
    )
    cells = (
        (name, *(short(v) if isinstance(v, float) else v for v in row[:-1]))
        for name, row in zip(NETWORKS, rows, strict=True)
    )
    yield from table(heads, "l" + "r" * 9, cells)
    yield ""
