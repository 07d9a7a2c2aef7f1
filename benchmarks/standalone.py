"""A scene as a page in one file: size, time to make, and how fast its WebAssembly runs.

Runs of 3 s take turns in rounds, each of a new instance, and the least time of each form counts.
`run` is the loop of `hapticlink run` alone, with native FMUs, all outputs recorded, and node runs
the module of the page; of both it is processor time. In Chromium the module runs in a worker of the
page, opened from the disk, by the wall clock: other processes take part of it. The file is made
without a cache of FMUs.
"""

from __future__ import annotations

import base64
import json
import subprocess
from pathlib import Path
from typing import Any

from benchmarks.dragging import chromium
from benchmarks.page import Progress, table
from benchmarks.timing import Row, made_anew, measured_scenes, simulated
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.visualization.browser_code import one_file
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.standalone import page

DURATION = 3.0
COLUMNS = ("scene", "bytes", "make_s", "run", "node", "chromium")
TIMED = """
const timed = (given, now, rounds) => {
  const module = new WebAssembly.Module(given.program), times = [];
  for (let i = 0; i < rounds; i++) {
    const program = new Program(module, given.data);
    const ticks = Math.round(given.duration * given.data.scene.haptics);
    const begun = now();
    program.run(ticks);
    times.push(now() - begun);
  }
  return Math.min(...times);
};
"""
"""The least time (s) of a run."""
IN_NODE = """
import { readFileSync } from "node:fs";
const now = () => { const { user, system } = process.cpuUsage(); return (user + system) / 1e6; };
const given = JSON.parse(readFileSync(0));
given.program = Buffer.from(given.program, "base64");
console.log(timed(given, now, ROUNDS));
"""
IN_CHROMIUM = """async ([worker, data, program, duration, rounds]) => {
  const source = new Blob([worker], { type: "text/javascript" });
  const started = new Worker(URL.createObjectURL(source));
  const answer = new Promise((resolve, reject) => {
    started.onmessage = ({ data }) => resolve(data);
    started.onerror = ({ message }) => reject(new Error(message));
  });
  const { buffer } = Uint8Array.from(atob(program), (c) => c.charCodeAt(0));
  started.postMessage([{ data, program: buffer, duration }, rounds]);
  return answer;
}"""
IN_WORKER = """
onmessage = ({ data: [given, rounds] }) =>
  postMessage(timed(given, () => performance.now() / 1e3, rounds));
"""


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes runs.csv into `folder`."""
    with chromium() as browser:

        def measure(scene: str, options: tuple[str, ...], rounds: int) -> list[tuple[object, ...]]:
            return [_measured(scene, options, rounds, browser)]

        rows = measured_scenes(folder, quick, progress, COLUMNS, measure)
    return _page(rows, command)


def _measured(
    scene: str, options: tuple[str, ...], rounds: int, browser: Any
) -> tuple[int, float, float, float, float]:
    """Size (bytes), processor time to make (s), and times real time of run, node and Chromium."""
    shown = load_viewed_scene(scene, (*options, "packaging=native"), DURATION)
    with temporary_folders.temporary_folder() as room:
        file = room / "page.html"
        make = made_anew(lambda: page.write_page(shown, scene, file), room / "cache")
        text = file.read_text(encoding="utf-8")
        opened = browser.new_page()
        opened.goto(f"file://{file}")
        opened.wait_for_function('() => typeof view !== "undefined" && view.frame')
        opened.click("#pause")
        runs, nodes, wall = list[float](), list[float](), list[float]()
        for _ in range(rounds):
            runs.append(simulated(shown, room / "run", csv=False).outcome.wall_time)
            nodes.append(_node(text))
            worker = one_file.unpack_text(text, "worker").decode() + TIMED + IN_WORKER
            wall.append(opened.evaluate(IN_CHROMIUM, [worker, *_program(text).values(), 5]))
        opened.close()
        by_run, by_node, by_chromium = (DURATION / min(times) for times in (runs, nodes, wall))
        return len(text.encode()), make, by_run, by_node, by_chromium


def _node(text: str) -> float:
    """The least processor time (s) of a run of a page's module under node."""
    code = one_file.bundle("program.js") + TIMED + IN_NODE.replace("ROUNDS", "5")
    command = ["node", "--input-type=module", "--eval", code]
    done = subprocess.run(
        command, input=json.dumps(_program(text)), capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def _program(text: str) -> dict[str, Any]:
    """The program in a page, and how long it shall run."""
    return {
        "data": json.loads(one_file.unpack_text(text, "data")),
        "program": base64.b64encode(one_file.unpack_text(text, "program")).decode(),
        "duration": DURATION,
    }


def _page(rows: list[Row], command: str) -> str:
    first = rows[0]
    method = " ".join((__doc__ or "").partition("\n\n")[2].split())
    run, node, browser = (float(first[c]) for c in ("run", "node", "chromium"))
    text = f"""# A scene as a page in one file

{first["scene"]} is a file of {int(first["bytes"]) / 1e3:.0f} kB, which runs {browser:.0f} times real time in a worker of Chromium and {node:.0f} times under node; its run through FMUs {run:.0f} times.

Made by `{command}`. {method} Measured on a machine with much other work, which shares caches and cores: ratios of processor times hold, other times do not. All rows: [runs.csv](runs.csv).

"""  # noqa: E501
    heads = "scene | kB | s of processors to make | run, times real time | node | Chromium"
    return text + "\n".join(table(heads, "lrrrrr", map(_cells, rows))) + "\n"


def _cells(row: Row) -> list[str]:
    times = [f"{float(row[column]):.0f}" for column in ("run", "node", "chromium")]
    return [row["scene"], f"{int(row['bytes']) / 1e3:.0f}", f"{float(row['make_s']):.1f}", *times]
