"""Draws the start of each shipped scene and of the linkages in own-linkage.md and scenes.md to
docs/pictures/<scene>.png, and block diagrams and schematics to docs/figures/:

python docs/draw_scenes.py
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hapticlink as hl
from hapticlink.analysis.findings.start_values import coordinates, mechanism_outputs
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization.figures import block_diagram, schematic
from hapticlink.visualization.mechanism import drawing, workspace_drawing

PAGES = [Path(__file__).with_name(name) for name in ("own-linkage.md", "scenes.md")]
PICTURES, FIGURES = (Path(__file__).with_name(name) for name in ("pictures", "figures"))
DPI = 80
SAME = {"metadata": {"Software": None}}  # the same bytes every time


def examples(folder: Path) -> Iterator[Path]:
    """The scene files of the pages, written to `folder`."""
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for name, text in re.findall(r'```toml title="(.+?)"\n(.*?)```', pages, re.DOTALL):
        path = folder / name
        path.write_text(text, encoding="utf-8")
        yield path


def draw(scene: str | Path) -> Path:
    """Draws a scene, given by its name or path, and returns the picture's path."""
    read = hl.scene(scene)
    with build_system(read) as system:
        q = coordinates(mechanism_outputs(system))
    path = PICTURES / f"{Path(scene).stem}.png"
    drawing.figure(read, q).savefig(path, dpi=DPI, **SAME)
    return path


def blocks(scene: str, file: str) -> Path:
    """Draws the block diagram of a scene to a file of FIGURES, and returns its path."""
    with build_system(hl.scene(scene)) as system:
        figure = block_diagram.figure(system, f"The blocks of {scene} and their signals")
    figure.savefig(FIGURES / file, dpi=90, **SAME)
    return FIGURES / file


def inside(scene: str, drawing: str, file: str) -> Path:
    """Draws a schematic of a scene to a file of FIGURES, and returns its path."""
    read = hl.scene(scene)
    with build_system(read) as system:
        figure = schematic.figures(read, system)[drawing]
    figure.savefig(FIGURES / file, dpi=80, **SAME)
    return FIGURES / file


def device(scene: str, file: str = "device.png") -> Path:
    """Draws the device of a scene in its workspace, and returns the picture's path."""
    read = hl.scene(scene)
    with build_system(read) as system:
        start = mechanism_outputs(system)
    pose = [start[f"x[{i}]"] for i in (1, 2, 3)]
    figure = workspace_drawing.draw(read.device, pose, f"Device and its workspace: {read.title}")
    figure.savefig(FIGURES / file, dpi=90, **SAME)
    return FIGURES / file


def events(scene: str) -> Path:
    """Draws the distance over a run of a scene with events, and returns the picture's path."""
    with tempfile.TemporaryDirectory() as folder:
        run = hl.run(scene, out=Path(folder) / "run")
        run.figures()["distance"].savefig(FIGURES / f"{scene}.png", dpi=110, **SAME)
    return FIGURES / f"{scene}.png"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for scene in (*hl.shipped(), *examples(Path(folder))):
            print(draw(scene))
    print(device("closed-loop"))
    print(device("closed-loop-2diy", file="device-2diy.png"))
    print(blocks("closed-loop-ideal", "blocks.png"))
    print(blocks("virtual-wall", "blocks-of-a-wall.png"))
    print(inside("closed-loop", "device", "inside-device.png"))
    print(inside("closed-loop", "inside-virtual-mechanism", "inside-mechanism.png"))
    print(inside("closed-loop-b1", "simulation", "inside-simulation.png"))
    print(events("scenario"))
