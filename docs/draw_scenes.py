"""Draws the mechanism of each shipped scene, and of the example in mechanisms.md, at its start, to
docs/pictures/<scene>.png:

python docs/draw_scenes.py
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import hapticlink as hl
from hapticlink.orchestrator.commands.info import at_start, coordinates
from hapticlink.orchestrator.results import mechanism_drawing
from hapticlink.orchestrator.system.built import built

PAGE = Path(__file__).with_name("mechanisms.md")
PICTURES = Path(__file__).with_name("pictures")
DPI = 80


def example(folder: Path) -> Path:
    """The scene file of the example, written to `folder`."""
    found = re.search(r'```toml title="(.+?)"\n(.*?)```', PAGE.read_text("utf-8"), re.DOTALL)
    assert found, f"{PAGE} has no example"
    path = folder / found[1]
    path.write_text(found[2], encoding="utf-8")
    return path


def draw(scene: str | Path) -> Path:
    """Draws a scene, given by its name or path, and returns the picture's path."""
    read = hl.scene(scene)
    with built(read) as system:
        q = coordinates(at_start(system))
    PICTURES.mkdir(exist_ok=True)
    path = PICTURES / f"{Path(scene).stem}.png"
    figure = mechanism_drawing.figure(read, q)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})  # the same bytes every time
    return path


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for scene in (*hl.shipped(), example(Path(folder))):
            print(draw(scene))
