"""A blind trial: settings of a scene against the scene itself, in an order that nobody knows."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scipy import stats

from hapticlink.analysis.sweep import grid
from hapticlink.analysis.trials.order import Staircase, Staircases, in_random_order
from hapticlink.analysis.trials.psychometric import GUESS, PsychometricFit, fit_threshold
from hapticlink.orchestrator.base.errors import InputFault

Settings = Mapping[str, str]
Present = Callable[[int, int, Settings], object]
"""Lets somebody feel the settings, in trial so and so as the first (1) or the second (2)."""
Ask = Callable[[int], int | None]
"""Asks in which of the two of a trial the setting was varied, 1 or 2; None ends the trials."""
COLUMNS = ("trial", "varied", "answer", "right")


@dataclass(frozen=True)
class TrialAnswer:
    """An answer, 1 or 2, in a trial in which the setting number so and so was `varied`, 1 or 2."""

    setting: int
    varied: int
    answer: int

    @property
    def right(self) -> bool:
        return self.answer == self.varied


@dataclass
class BlindTrial:
    """Settings that are compared with the reference, which has none of them, and the answers.

    level: the key whose values are levels of one scale; None where the settings are names only.
    """

    settings: Sequence[Settings]
    level: str | None
    answers: list[TrialAnswer] = field(default_factory=list)

    @classmethod
    def of(cls, vary: grid.Vary) -> BlindTrial:
        """That of every combination of values. Raises InputFault where two keys have levels."""
        axes = grid.axes(vary)
        scales = [axis.key for axis in axes if axis.is_scale]
        if len(scales) > 1:
            raise InputFault(
                f"--vary {scales[0]} and {scales[1]}: a threshold is one of one key: give one "
                "value of the others, or names"
            )
        return cls(grid.grid(axes), scales[0] if scales else None)

    def groups(self) -> dict[str, list[int]]:
        """The settings that differ in the level alone, by what they have in common."""
        found: dict[str, list[int]] = {}
        for i, setting in enumerate(self.settings):
            common = ", ".join(f"{k}={v}" for k, v in setting.items() if k != self.level)
            found.setdefault(common, []).append(i)
        return found

    def ask(
        self,
        present: Present,
        ask: Ask,
        *,
        repeats: int = 10,
        staircase: bool = False,
        reference: float | None = None,
        seed: int = 0,
        done: Callable[[BlindTrial], object] = lambda trial: None,
    ) -> None:
        """Ask trial after trial, `done` after each. reference: the level of the scene itself, from
        which a staircase's levels are the easier to tell the farther they are. Raises InputFault
        for a staircase without levels."""
        stairs = Staircases(self._staircases(reference), seed) if staircase else None
        for number, pair in enumerate(
            stairs or in_random_order(len(self.settings), repeats, seed), start=1
        ):
            varied = 1 if pair.varied_first else 2
            for place in (1, 2):
                present(number, place, self.settings[pair.setting] if place == varied else {})
            given = ask(number)
            if given is None:
                return
            self.answers.append(TrialAnswer(pair.setting, varied, given))
            if stairs:
                stairs.answer(given == varied)
            done(self)

    def _staircases(self, reference: float | None) -> list[Staircase]:
        if self.level is None or reference is None:
            raise InputFault("--staircase: it goes up and down the values of a key: vary a number")

        def difference(setting: int) -> float:
            assert self.level
            assert reference is not None
            level = float(self.settings[setting][self.level])
            both = level > 0 and reference > 0
            return abs(math.log(level / reference) if both else level - reference)

        return [
            Staircase(sorted(group, key=difference, reverse=True))
            for group in self.groups().values()
        ]

    # --- what the answers say ---------------------------------------------------------------

    def counts(self) -> list[tuple[int, int]]:
        """Right answers and trials of each setting."""
        given = [
            [a.right for a in self.answers if a.setting == i] for i in range(len(self.settings))
        ]
        return [(sum(right), len(right)) for right in given]

    def shares(self) -> list[dict[str, Any]]:
        """Of each setting that was felt: share of right answers with its exact 95 % interval
        (Clopper and Pearson, Biometrika 26 (1934) 404-413), and the probability that guessing
        gives as many."""
        rows = []
        for setting, (right, n) in zip(self.settings, self.counts(), strict=True):
            if n:
                test = stats.binomtest(right, n, GUESS, alternative="greater")
                low, high = stats.binomtest(right, n, GUESS).proportion_ci()
                rows.append(
                    {**setting, "trials": n, "right": right, "share": right / n}
                    | {"low": float(low), "high": float(high), "by_guessing": float(test.pvalue)}
                )
        return rows

    def thresholds(self) -> dict[str, PsychometricFit | str]:
        """The threshold of the level, or why there is none, by what its settings have in common;
        empty without a level."""
        if self.level is None:
            return {}
        counts, found = self.counts(), {}
        for common, group in self.groups().items():
            felt = [i for i in group if counts[i][1]]
            levels = [float(self.settings[i][self.level]) for i in felt]
            found[common] = fit_threshold(
                levels, [counts[i][0] for i in felt], [counts[i][1] for i in felt]
            )
        return found

    def write(self, path: Path) -> None:
        """Write the answers as a CSV, a row for each trial."""
        keys = list(dict.fromkeys(key for setting in self.settings for key in setting))
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow((COLUMNS[0], *keys, *COLUMNS[1:]))
            for i, a in enumerate(self.answers, start=1):
                values = (self.settings[a.setting].get(key, "") for key in keys)
                writer.writerow((i, *values, a.varied, a.answer, int(a.right)))
