"""Functions of the API with arguments that are none, drawn from their signatures: each call
returns, or raises a Fault of this project, or TypeError."""

from __future__ import annotations

import inspect
import os
import random
import signal
import traceback
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import hapticlink as hl
from fuzz.cases import Made, seeded
from fuzz.processes import own_folder
from hapticlink.orchestrator.base.errors import Fault

VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 7, 2**70, 0.5, -0.5, 1e300, float("nan"), float("inf")),
    *("", "x", "a\0b", "../x", "/dev/null/x", "/proc/x", "\ud800", "x" * 5000, b"x", "pendulum"),
    *([], [1], ["x"], [None], ["duration=0.02"], ["duration"], {}, {"x": 1}, {"duration": -1}),
    *({1: 2}, {"duration": object()}, {"duration": [1]}, (), (1, 2), object(), print, Path("x")),
    *({"duration": float("nan")}, {"hold": None}, {"graphics.rate": 1j}, range(3), iter([])),
)
GOOD: dict[str, Any] = {"scene": "pendulum", "options": {"duration": 0.02}}
FUNCTIONS = (
    *("run", "scene", "load", "explain", "export", "build", "sweep", "shipped"),
    *("compare", "fit", "stability", "equilibrium_stability", "passivity", "transparency"),
)
PATIENCE = 300
"""Seconds for a call, which may build for every platform on a busy machine."""


def _functions() -> dict[str, Callable[..., object]]:
    return {name: getattr(hl, name) for name in FUNCTIONS if callable(getattr(hl, name, None))}


def _drawn(
    function: Callable[..., object], draw: random.Random
) -> tuple[list[Any], dict[str, Any]]:
    """Arguments by the signature, one or two of them wrong."""
    positional, named = [], {}
    parameters = [*inspect.signature(function).parameters.values()]
    wrong = {p.name for p in draw.sample(parameters, min(len(parameters), draw.choice((1, 1, 2))))}
    for p in parameters:
        value = draw.choice(VALUES) if p.name in wrong else GOOD.get(p.name, p.default)
        if value is inspect.Parameter.empty:
            value = "out" if p.name == "out" else draw.choice(VALUES)
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD):
            positional.append(value)
        elif p.kind is p.KEYWORD_ONLY:
            named[p.name] = value
    return positional, named


def _live(draw: random.Random) -> tuple[str, Callable[[], object]]:
    """A call of a method of a scene that runs, and what it is."""
    names = ("set", "hold", "rate", "step", "__getitem__")
    name = draw.choice(names)
    count = draw.choice((1, 2, 3))
    values = [draw.choice(VALUES) for _ in range(count)]
    if draw.random() < 0.7:
        first = {"set": "hand.wrench", "rate": "graphics", "__getitem__": "hand.F"}
        values[0] = first.get(name, "virtual_environment.Lambda_inv" if name == "hold" else 1)

    def call() -> object:
        def turn(live: hl.RealTime) -> None:
            try:
                getattr(live, name)(*values)
            finally:
                live.resume()
            live.stop()

        return hl.RealTime("closed-loop-ideal", {"duration": 0.05}).run(turn)

    return f"RealTime.{name}{ascii(tuple(values))[:200]}", call


def _outcome(call: Callable[[], object], folder: Path) -> tuple[str, str]:
    """Of a call in a process of its own, in `folder`."""
    output = folder / "said.txt"
    output.unlink(missing_ok=True)
    process = os.fork()
    if process == 0:
        try:
            os.chdir(folder)
            said = os.open(output, os.O_WRONLY | os.O_CREAT)
            os.dup2(said, 1)
            os.dup2(said, 2)
            signal.alarm(PATIENCE)
            call()
            os._exit(0)
        except Fault:
            os._exit(1)
        except TypeError:
            os._exit(2)
        except BaseException as error:
            os.write(2, "".join(traceback.format_exception(error)).encode(errors="replace")[-700:])
            os._exit(3)
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    if code in (0, 1, 2):
        return ("done", "told", "refused")[code], ""
    text = output.read_text(errors="replace")[-500:] if output.exists() else ""
    return ("hung" if code == -signal.SIGALRM else "crashed"), f"{code}: {text}"


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` calls, the functions in turn."""
    functions = _functions()
    kinds = [*functions, "RealTime"]
    hl.run("closed-loop-ideal", {"duration": 0.02})  # FMUs are built before
    with own_folder() as folder:
        for i, _, draw in seeded(number, seed):
            kind = kinds[i % len(kinds)]
            if kind == "RealTime":
                case, call = _live(draw)
            else:
                positional, named = _drawn(functions[kind], draw)
                case = f"{kind}({ascii(positional)[:200]}, {ascii(named)[:200]})"
                call = partial(functions[kind], *positional, **named)
            yield Made(kind, case, *_outcome(call, folder))
