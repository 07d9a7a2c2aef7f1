"""Draws the replays of results/view/: the animation of the README, screenshots of a replay and of a
report in a headless Chromium, and the figures of a run and of a comparison.

`python docs/draw_replay.py`, with playwright and Debian's chromium installed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

import hapticlink as hl
from hapticlink.orchestrator.results.folders import load_by_name
from hapticlink.visualization import figure_files
from hapticlink.visualization.compare import overlay
from hapticlink.visualization.compare import page as report
from hapticlink.visualization.figures import run_figures
from hapticlink.visualization.replay import replay_page
from hapticlink.visualization.replay.recorded_frames import Recorded

OUT = Path(__file__).parents[1] / "results" / "view"
RUNS = {"joint constraints rendered": True, "without them": False}
"""By the name of its folder, whether a run has the topology controller."""
SHOTS = {
    "replay": ((1360, 820), "view.seek(1.9)"),
    "overlay": ((1360, 820), "(view.seek(1.9), document.getElementById('layout').click())"),
    "replay_narrow": ((400, 860), "view.seek(1.9)"),
}
"""By file, the window (px) and what is done in it."""


def main() -> None:
    with sync_playwright() as started, tempfile.TemporaryDirectory() as room:
        folders = [Path(room) / name for name in RUNS]
        for folder, topology in zip(folders, RUNS.values(), strict=True):
            options = {"controller.topology": topology}
            hl.run("closed-loop", options, out=folder, figures=False)
        OUT.joinpath("figures").mkdir(exist_ok=True)
        figure_files.save(run_figures.figures(hl.run("enclosure")), OUT / "figures")
        over = overlay.figures(load_by_name(folders))
        figure_files.save({f"compare_{name}": f for name, f in over.items()}, OUT / "figures")
        runs = [Recorded(str(folder)) for folder in folders]
        replay_page.write_replay(runs, OUT / "topology.gif")
        page = started.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        ).new_page()
        file = Path(room) / "page.html"
        replay_page.write_replay(runs, file)
        for name, ((width, height), act) in SHOTS.items():
            page.set_viewport_size({"width": width, "height": height})
            page.goto(file.as_uri())
            page.evaluate(act)
            page.wait_for_timeout(300)
            page.screenshot(path=OUT / f"{name}.png")
        file.write_text(report.page(load_by_name(folders)), encoding="utf-8")
        page.set_viewport_size({"width": 1100, "height": 1500})
        page.goto(file.as_uri())
        page.screenshot(path=OUT / "report.png")


if __name__ == "__main__":
    main()
