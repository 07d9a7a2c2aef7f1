"""Draws docs/figures/trial.png, the answers of a simulated observer: python docs/draw_trial.py"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from hapticlink.analysis.trials.blind_trial import BlindTrial
from hapticlink.visualization.figure_files import save
from hapticlink.visualization.figures import trial_figure

THRESHOLD, SLOPE, LAPSE = 20.0, -5.0, 0.02
"""Of the observer, in Hz and 1/log(Hz)."""


def main() -> None:
    draw = np.random.default_rng(3)
    trial = BlindTrial.of(["graphics.rate=8,11,16,22,31,44,62"])
    felt: list[tuple[int, float]] = []

    def present(number: int, place: int, settings: dict[str, str]) -> None:
        if settings:
            felt.append((place, float(settings["graphics.rate"])))

    def ask(number: int) -> int:
        varied, rate = felt[-1]
        told = 1 / (1 + math.exp(-SLOPE * math.log(rate / THRESHOLD)))
        return varied if draw.random() < 0.5 + (0.5 - LAPSE) * told else 3 - varied

    trial.ask(present, ask, repeats=24, seed=3)  # type: ignore[arg-type]
    save({"trial": trial_figure.draw(trial)}, Path(__file__).parent / "figures")


if __name__ == "__main__":
    main()
