from __future__ import annotations

import secrets
import sys
from typing import Annotated, Any

from cyclopts import Parameter

from hapticlink.commands.options import (
    PRINTED,
    UNCHANGED,
    Format,
    Output,
    Scene,
    SceneOptions,
    default_folder,
    title,
)
from hapticlink.commands.page_server import LOCAL, PageAddress
from hapticlink.commands.run import Device
from hapticlink.commands.stop_key import read_line
from hapticlink.commands.sweep import Vary
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.terminal_output import say

Repeats = Annotated[int, Parameter(help="Trials of each setting, if there is no --staircase.")]
Stairs = Annotated[
    bool,
    Parameter(
        negative="",
        help="Go to harder levels after two right answers, to easier ones after a wrong one.",
    ),
]
Seed = Annotated[int, Parameter(help="Of the order of trials.")]
OnPage = Annotated[
    bool,
    Parameter(name="--page", negative="", help="Feel and answer on a page, where the mouse pulls."),
]


def trial(
    scene: Scene,
    /,
    *,
    vary: Vary = None,
    changes: SceneOptions = UNCHANGED,
    device: Device = None,
    repeats: Repeats = 10,
    staircase: Stairs = False,
    seed: Seed = 0,
    page: OnPage = False,
    address: PageAddress = LOCAL,
    format: Format = "png",
    output: Output = PRINTED,
) -> int:
    """Let somebody feel settings of a scene on a board or on a page, blindly: in each trial the
    scene as it is and one of the settings of --vary, in an order that is drawn; then it asks which
    was varied.

    Each is felt for the scene's duration, from where it starts. Writes answers.csv, a row for each
    trial, shares.csv, trial.png and what was felt, `felt/001-1/` and so on, to OUT (default
    trials/SCENE). The threshold of a number that is varied is where the share of right answers is
    half-way between guessing and knowing.

    For example:

        hapticlink trial closed-loop --device /dev/ttyACM0 --vary graphics.rate=8,12,18,26,40
        hapticlink trial closed-loop --device /dev/ttyACM0 --vary hold=zoh,foh --vary
        graphics.rate=8,12,18,26,40 --staircase --seed 3
        hapticlink trial closed-loop-direct --page --vary graphics.rate=8,12,18,26,40
    """
    from hapticlink.api.trials import trial as hold_trial

    if not vary:
        raise InputFault(
            "trial: give the settings that are compared with the scene, --vary key=values"
        )
    folder = output.out or default_folder("trials", scene)
    how: dict[str, Any] = {
        "repeats": repeats, "staircase": staircase, "seed": seed, "out": folder, "format": format,
    }  # fmt: skip
    if not page:
        result = hold_trial(scene, vary, changes.options, device=device, ask=_ask, **how)
    else:
        import hapticlink as hl
        from hapticlink.api.runs import with_board
        from hapticlink.orchestrator.scene.overrides import write_options
        from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
        from hapticlink.visualization.live_page.trial_page import TrialPage

        options = (*changes.options, *write_options(with_board(device)))
        read = load_viewed_scene(scene, options, hl.scene(scene, options).duration)
        token = secrets.token_urlsafe(16)
        with address.start_server(token) as link:
            address.show_served(read.title, link, token)
            shown = TrialPage(link, hl.RealTime, read)
            result = hold_trial(read, vary, ask=shown.ask, feel=shown.feel, **how)
            shown.tell(f"{result}: the trials have ended")
    lines = [*result.lines(), f"{folder}/: {', '.join(result.files)}"]
    output.show(f"{title(scene)}: {result}", lines, result.record())
    return 0


def _ask(question: str, answers: str) -> str:
    """Ask in the terminal."""
    while True:
        say(f"{question} [{answers}]", file=sys.stderr)
        line = read_line()
        given = line.strip().lower()
        if not line:
            return "q"
        if given in answers.split("/"):
            return given
