"""Draws docs/figures/measured.png, a run with the simulated board over the same scene simulated:
python docs/draw_measured.py"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import hapticlink as hl
from hapticlink.visualization.figure_files import save

OPTIONS = {"device.extends": "2diy", "controller.bias": "full", "packaging": "native"}
BESIDE = {"sensing": "encoders", "device.observer.beside": True}


def main() -> None:
    with TemporaryDirectory() as room:
        simulated = Path(room, "simulated")
        measured = Path(room, "measured")
        hl.run("closed-loop", OPTIONS | BESIDE, out=simulated, figures=False)
        hl.run(
            "closed-loop", OPTIONS, out=measured, figures=False, real_time=True,
            device="simulated-board",
        )  # fmt: skip
        drawn = hl.compare([measured, simulated]).figures()["distance"]
        save({"measured": drawn}, Path(__file__).parent / "figures")


if __name__ == "__main__":
    main()
