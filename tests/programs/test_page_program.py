"""A scene as WebAssembly, under node: against the same C for the machine, and against a run that is
changed in the same way at the same ticks."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fmpy
import numpy as np
import pytest

from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.pace import Pace
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.programs.build import components
from hapticlink.programs.page_program import write_page_sources
from hapticlink.programs.ports import ports
from hapticlink.programs.resolve_scene import resolve_scene
from hapticlink.visualization.browser_code import one_file
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene, mouse
from hapticlink.visualization.standalone import page
from hapticlink.visualization.standalone.description import PageDescription
from tests.visualization.browser_code.javascript import javascript

P_C = "virtual_environment.P_c -> controller.P_c"
CHANGES: list[tuple[int, dict[str, Any]]] = [
    (10, {"type": "hand", "at": [0.06, -0.01]}),
    (40, {"type": "set", "key": "graphics.rate", "value": 10.0}),
    (90, {"type": "set", "key": f"holds.{P_C}", "value": "foh"}),
    (150, {"type": "set", "key": "graphics.rate", "value": 77.0}),
    (170, {"type": "set", "key": f"delays.{P_C}", "value": 0.0205}),
    (260, {"type": "set", "key": f"holds.{P_C}", "value": "smooth"}),
    (300, {"type": "set", "key": "gains.controller.k_j", "value": 3.0}),
    (330, {"type": "set", "key": f"delays.{P_C}", "value": 0.0}),
    (350, {"type": "set", "key": "controller.topology", "value": False}),
    (400, {"type": "set", "key": "graphics.rate", "value": 200.0}),
    (420, {"type": "hand", "at": None}),
    (430, {"type": "set", "key": "graphics.rate", "value": 30.0}),
]
"""After so many haptic events."""
EVENTS = 512
RUN = """
const module = new WebAssembly.Module(Buffer.from(given.program, "base64"));
const program = new Program(module, given.data);
const changes = [...given.changes];
answer = [];
for (let i = 1; i <= given.events; i++) {
  program.run();
  answer.push([...program.numbers(program.c.signal_values(program.m), given.data.n_values)]);
  while (changes.length && changes[0][0] === i) program.apply(changes.shift()[1]);
}
"""


def dragged(options: tuple[str, ...] = ()) -> Scene:
    return load_viewed_scene("closed-loop-ideal", options, duration=1.5)


@cache
def page_of(options: tuple[str, ...]) -> str:
    """The page of `dragged`."""
    return page.html(dragged(options), "page")


def under_node(text: str, changes: list[tuple[int, dict[str, Any]]]) -> np.ndarray:
    """The vector of signals of a page after each haptic event."""
    data = json.loads(one_file.unpack_text(text, "data"))
    program = base64.b64encode(one_file.unpack_text(text, "program")).decode()
    given = {"data": data, "program": program, "changes": changes}
    return np.array(javascript("program.js", RUN, given | {"events": EVENTS}))


def changed_run(scene: Scene, apply: Callable[[LiveRun, Any], None]) -> np.ndarray:
    """The same of a run in the loop of every run, whose holds, rate and gains change as those of a
    run in real time, without waiting for a clock."""
    rows, changes = list[np.ndarray](), [*CHANGES]
    with build_system(scene) as system, ExitStack() as stack:
        simulation = Simulation(system, RunResults(), stack)
        loop = CompiledLoop(Plan(system), simulation)
        simulation.pace = Pace()  # rates may change: tables have room for more rows
        simulation.start()
        live = LiveRun(scene)
        vars(live).update(
            _simulation=simulation, _loop=loop, _setters={}, _connections={}, _places={},
            _run=SimpleNamespace(changes=[]),
        )  # fmt: skip
        haptic = system.timeline.clocks[0].longest

        def turn(tick: int) -> None:
            if tick % haptic or len(rows) != tick // haptic:
                return
            rows.append(simulation.signals.values.copy())
            while changes and changes[0][0] == len(rows):
                apply(live, changes.pop(0)[1])
                for instance in simulation.instances.values():
                    instance.settle(simulation.seconds(tick))  # as a run in real time does

        loop.events.patience(0)
        loop.run(turn)
    return np.array(rows[:EVENTS])


def apply(live: LiveRun, message: dict[str, Any]) -> None:
    """As visualization/live_page/controls.py does, written out for these gains."""
    match message:
        case {"type": "hand", "at": None}:
            live.set("hand.stiffness", (0.0, 0.0, 0.0))
        case {"type": "hand", "at": at}:
            live.set("hand.target", (*at, 0.0))
            live.set("hand.stiffness", mouse(live.scene.space)[0])
        case {"key": "graphics.rate", "value": rate}:
            own = live.scene.graphics and live.scene.graphics.rate
            live.rate("graphics", None if rate == own else rate)
        case {"key": "gains.controller.k_j"}:
            live.set("controller.k_j", 600.0)
        case {"key": "controller.topology"}:
            live.set("controller.k_j", 0.0)
            live.set("controller.b_j", 0.0)
        case {"key": key, "value": value}:
            live.hold(P_C, *((value,) if key.startswith("holds.") else (None, value)))


@pytest.mark.parametrize("options", [(), ("graphics.rate=32", "coupling=jacobi")])
def test_changes_are_those_of_a_run_in_real_time(options: tuple[str, ...]) -> None:
    expected = changed_run(dragged(options), apply)
    found = under_node(page_of(options), CHANGES)
    assert found.shape == expected.shape
    assert np.ptp(found, axis=0).max() > 1
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-9), np.abs(found - expected).max(axis=1)


MAIN = """
#include <stdio.h>
#include <stdint.h>
void *create(void);
int set(void *, unsigned, double), begin_run(void *), run(void *, int);
const double *signal_values(const void *);
int main(void) {
    void *m = create();
    begin_run(m);
    for (int i = 0; i < EVENTS; i++) {
        run(m, 1);
        if (i == 9) { SET }
        fwrite(signal_values(m), sizeof(double), N_NUMBERS, stdout);
    }
}
"""


# Zig builds musl first, which takes 40 s of processor time.
MUSL = (
    ["musl-gcc", "-static"]
    if shutil.which("musl-gcc")
    else [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-linux-musl"]
)


@pytest.mark.skipif(fmpy.platform != "linux64", reason="runs a program for Linux")
def test_webassembly_has_the_bits_of_the_same_c_with_the_same_sine(tmp_path: Path) -> None:
    """Against a program for this machine with musl, whose mathematics WebAssembly has, too."""
    with resolve_scene(dragged(), changing=True) as program:
        made = components(program)
        variables = ports(program, made)
        description = PageDescription(program, variables, "page")
        files = write_page_sources(
            program, made, variables, description.drawing, description.data["parameters"]
        )
    references = description.data["parameters"]
    pull = dict(zip(references["hand.target"], (0.06, -0.01, 0.0), strict=True))
    pull |= dict(zip(references["hand.stiffness"], mouse(PLANE)[0], strict=True))
    main = MAIN.replace("SET", " ".join(f"set(m, {r}, {v});" for r, v in pull.items()))
    (tmp_path / "main.c").write_text(main)
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    numbers = description.data["n_values"]
    sizes = [f"-DEVENTS={EVENTS}", f"-DN_NUMBERS={numbers}", "-DEXPORT="]
    command = [*MUSL, "-std=gnu11", "-O0", "-ffp-contract=off", "-w", *sizes, "-o", "native"]
    command += [*(p.name for p in tmp_path.glob("*.c")), "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    native = subprocess.run(["./native"], cwd=tmp_path, check=True, capture_output=True).stdout
    expected = np.frombuffer(native).reshape(EVENTS, numbers)
    found = under_node(page_of(()), [(10, {"type": "hand", "at": [0.06, -0.01]})])
    assert np.ptp(found[10:], axis=0).max() > 1
    # 10 events, then the pull acts; JSON has no -0.
    assert np.array_equal(found, expected + 0.0)
