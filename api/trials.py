"""Lets somebody feel settings of a scene blindly."""

from __future__ import annotations

import csv
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hapticlink.analysis.sweep.grid import Vary
from hapticlink.analysis.trials.blind_trial import BlindTrial, Settings
from hapticlink.api import runs
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.scene.blocks import driver_of
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import flat
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization import figure_files
from hapticlink.visualization.figures import trial_figure

Ask = Callable[[str, str], str]
"""Asks a question, whose answers are separated by /, of whoever feels; returns one of them."""
STOP = "q"
ANSWERS, SHARES, FELT = "answers.csv", "shares.csv", "felt"


@dataclass(frozen=True)
class Trials:
    """The answers of a blind trial and what they say; `files` are in `folder`."""

    trial: BlindTrial
    folder: Path
    files: tuple[str, ...]

    def __str__(self) -> str:
        right = sum(answer.right for answer in self.trial.answers)
        return f"{right} of {len(self.trial.answers)} answers right"

    def lines(self) -> list[str]:
        """What the answers say, in words."""
        found = []
        for common, fit in self.trial.thresholds().items():
            where = f"{common}: " if common else ""
            if isinstance(fit, str):
                found.append(f"{where}no threshold of {self.trial.level}: {fit}")
                continue
            low = "below the levels" if fit.low is None else f"{fit.low:.3g}"
            high = "above the levels" if fit.high is None else f"{fit.high:.3g}"
            found.append(
                f"{where}threshold of {self.trial.level} {fit.threshold:.3g}, with 95 % confidence "
                f"{low} to {high}"
            )
        if self.trial.level is None:
            for row in self.trial.shares():
                names = ", ".join(f"{k}={row[k]}" for k in self.trial.settings[0])
                found.append(
                    f"{names}: {row['right']} of {row['trials']} right, "
                    f"{100 * row['low']:.0f} to {100 * row['high']:.0f} % with 95 % confidence"
                )
        return found

    def record(self) -> dict[str, Any]:
        """The same as plain data."""
        thresholds = {
            common: {"none": fit} if isinstance(fit, str) else asdict(fit)
            for common, fit in self.trial.thresholds().items()
        }
        return {
            "folder": str(self.folder),
            "answers": [asdict(a) | {"right": a.right} for a in self.trial.answers],
            "settings": [dict(s) for s in self.trial.settings],
            "level": self.trial.level,
            "shares": self.trial.shares(),
            "thresholds": thresholds,
        }


def trial(
    scene: str | Path | Scene,
    vary: Vary,
    options: Options = (),
    *,
    ask: Ask,
    out: str | Path,
    device: str | None = None,
    repeats: int = 10,
    staircase: bool = False,
    seed: int = 0,
    format: str = "png",
    feel: Callable[[Scene, Path], object] | None = None,
) -> Trials:
    """Let somebody feel each combination of `vary` against the scene itself, and `ask` which was
    the varied one. `feel` lets a scene be felt, by default by a run in real time on the board
    `device` that is written to a folder. Each is felt `repeats` times in an order drawn with
    `seed`, or `staircase` decides which comes next (docs/trials.md). All is in `out`, with a figure
    of this `format`: answers.csv grows with each answer, so that an interrupted trial loses none.

    Raises InputFault for settings that do not fit the scene, and without a board.
    """
    read = open_scene.load(open_scene.load(scene, options), runs.with_board(device))
    board = driver_of(read, "")
    if feel is None and not board:
        raise InputFault(
            "trial: nobody feels a simulated device: give --device PORT, or --page to pull it with "
            "the mouse"
        )
    asked = BlindTrial.of(vary)
    scenes = [  # all are refused before the first is felt
        open_scene.load(read, [f"{key}={value}" for key, value in setting.items()])
        for setting in asked.settings
    ]
    begin = "handle at its start?" if board else "ready?"
    for each in (read, *scenes):  # so that none takes longer to begin
        with build_system(each):
            pass
    reference = dict(flat(read.tables())).get(asked.level) if asked.level else None
    folder = folders.ensure(Path(out))
    if (folder / ANSWERS).exists():
        raise InputFault(f"{folder / ANSWERS}: has answers of earlier trials: name another --out")

    def present(number: int, place: int, settings: Settings) -> None:
        index = asked.settings.index(settings) if settings else None
        if ask(f"trial {number}, {place} of 2: {begin}", "y/q") == STOP:
            raise EndOfTrials
        shown = read if index is None else scenes[index]
        (feel or _run)(shown, folder / FELT / f"{number:03d}-{place}")

    def answered(number: int) -> int | None:
        given = ask("which of the two was the varied one?", "1/2/q")
        return None if given == STOP else int(given)

    with suppress(EndOfTrials):
        asked.ask(
            present, answered, repeats=repeats, staircase=staircase, seed=seed,
            reference=float(reference) if isinstance(reference, int | float) else None,
            done=lambda trial: trial.write(folder / ANSWERS),
        )  # fmt: skip
    asked.write(folder / ANSWERS)
    files = [ANSWERS]
    if shares := asked.shares():
        with (folder / SHARES).open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [*shares[0]])
            writer.writeheader()
            writer.writerows(shares)
        figure = trial_figure.draw(asked)
        kinds = figure_files.formats(format)
        drawn = [(f"trial.{kind}", figure_files.encode(figure, kind)) for kind in kinds]
        files += [SHARES, *figure_files.write(drawn, folder)]
    return Trials(asked, folder, tuple(files))


class EndOfTrials(Exception):
    """Whoever feels has enough."""


def _run(scene: Scene, folder: Path) -> None:
    ended = runs.run(scene, out=folder, figures=False, real_time=True)
    if ended.fault:
        raise Fault(ended.fault)
