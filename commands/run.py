from __future__ import annotations

import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import (
    PRINTED,
    UNCHANGED,
    Format,
    Output,
    Scene,
    SceneOptions,
    print_result,
    repeatable,
    title,
)
from hapticlink.commands.progress import progress
from hapticlink.commands.stop_key import stop_key, wait_for_enter
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.base.terminal_output import say

Figures = Annotated[bool, Parameter(help="Draw figures, which takes longer than many runs do.")]
SetFile = Annotated[
    list[Path] | None,
    repeatable(
        "Parameter set (.ssv) for the FMUs of an SSP, or the [[fmu]] of a scene, by name, over "
        "which --set takes precedence"
    ),
]
Explain = Annotated[
    bool, Parameter(negative="", help="Print what would run when, from which samples; do not run.")
]
RealTime = Annotated[
    bool,
    Parameter(
        negative="",
        help="Pace the haptic loop by the wall clock, with FMUs of other rates beside it.",
    ),
]
Speed = Annotated[
    float,
    Parameter(
        help="Simulated seconds in one of the wall clock, in real time: less than 1 is slow motion."
    ),
]

Device = Annotated[
    str | None,
    Parameter(
        help="Port of the board in the place of the simulated device (/dev/ttyACM0, COM3), or "
        "simulated-board."
    ),
]
Remote = Annotated[
    list[str] | None,
    repeatable(
        "part=HOST:PORT, an FMU, or all FMUs at a rate such as graphics, that `hapticlink serve` "
        "serves there"
    ),
]
Key = Annotated[Path | None, Parameter(help="File of the key of --remote, as of `serve`.")]
Arrivals = Annotated[
    Path | None,
    Parameter(help="Folder of a run in real time: samples arrive when they arrived there."),
]


State = Annotated[
    Path | None,
    Parameter(
        name="--from",
        help="State of a run, from which this one goes on; without SCENE in the scene of that run.",
    ),
]
Save = Annotated[
    list[str] | None,
    repeatable("Save the state at a time (s), at the `end`, or every so often, as every=0.5"),
]


def run(
    scene: Scene | None = None,
    /,
    *,
    changes: SceneOptions = UNCHANGED,
    set_file: SetFile = None,
    figures: Figures = True,
    format: Format = "png",
    explain: Explain = False,
    real_time: RealTime = False,
    speed: Speed = 1.0,
    device: Device = None,
    remote: Remote = None,
    key: Key = None,
    arrivals: Arrivals = None,
    state: State = None,
    save: Save = None,
    output: Output = PRINTED,
) -> int:
    """Run a scene; write CSV files, run.json, plan.txt and figures to OUT (default
    `runs/SCENE`, with options `runs/SCENE,key=value,...`).

    A run replaces the results of an earlier one in its folder. The exit status is 0 for a regular
    end, 1 for a run that failed (results up to then are kept), 2 for bad input.

    For example:

        hapticlink run closed-loop
        hapticlink run closed-loop --set graphics.rate=10 --set hold=foh
        hapticlink run closed-loop --format pdf,svg
        hapticlink run my-scene.toml --no-figures --json > result.json
        hapticlink run closed-loop --save 1 --save end
        hapticlink run --from runs/closed-loop/at-1.state --set hold=foh
        hapticlink run closed-loop --real-time --device simulated-board
    """
    import hapticlink as hl
    from hapticlink.orchestrator.scene.blocks import driver_of

    if not (scene or state):
        raise InputFault("give the name or path of a scene, or the state of a run (--from)")
    if not scene:
        scene = str(state)
    elif state:
        changes = replace(changes, set=[*(changes.set or ()), f"resume={state.absolute()}"])
    if set_file:
        from hapticlink.orchestrator.ssp import set_files

        given = set_files.options(hl.scene(scene, changes.options), set_file)
        changes = replace(changes, set=[*given, *(changes.set or ())])
    from hapticlink.analysis.findings import summary

    if explain:
        say(*hl.explain(scene, changes.options), sep="\n")
        return 0
    folder = output.out or changes.folder("runs", scene)
    said: list[str] = []
    try:
        read = hl.scene(scene, changes.options)
        with ExitStack() as shown:
            stop = shown.enter_context(stop_key()) if real_time and not output.quiet else None
            if stop and (device or driver_of(read, "")):
                say("a key ends the run: motors are without torque then", file=sys.stderr)
            bar = progress(read.title, read.stop_time, hidden=output.quiet)

            def answer(result: hl.Run) -> None:
                """Says what it can before figures are drawn: all but the names of the files."""
                shown.close()
                if not (result.fault or output.quiet or output.json):
                    said.extend([*summary.print_lines(result, title(scene), result.numbers)][:-1])
                    say(*said, sep="\n")
                    sys.stdout.flush()

            result = hl.run(
                read,
                out=folder,
                figures=figures,
                format=format,
                progress=shown.enter_context(bar),
                answer=answer,
                real_time=real_time,
                speed=speed,
                arrivals=arrivals,
                device=device,
                stop=stop,
                ready=wait_for_enter,
                remote=dict(map(_place, remote or ())),
                key=key,
                save=save or (),
            )
    except hl.RunInterrupted as ended:
        result = ended.run
    if result.fault:
        say(f"hapticlink: {result.fault}", file=sys.stderr)
    lines = [*summary.print_lines(result, title(scene), result.numbers)]
    if output.quiet or output.json:
        for line in summary.warnings(result):
            say(f"hapticlink: {line}", file=sys.stderr)
    if not result.folder:
        lines.append(f"  {folder}/: nothing written, the run failed before the first sample")
    print_result(lines[len(said) :], result.run, output.quiet, output.json)
    return Fault.exit_status if result.fault else 0


def _place(given: str) -> tuple[str, str]:
    part, equals, address = given.partition("=")
    if not (part and equals and address):
        raise InputFault(f"--remote {given}: write part=HOST:PORT, e.g. graphics=127.0.0.1:5555")
    return part, address
