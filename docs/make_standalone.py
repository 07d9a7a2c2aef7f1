"""Writes the page in one file of each shipped scene, or of those named, to standalone/, from where
the documentation site takes it:

python docs/make_standalone.py [SCENE ...]

A page is kept while its scene and the sources are those that it was made of, so that a second call
goes on where the first one was interrupted. All together take minutes.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import hapticlink as hl
from hapticlink import analysis, orchestrator, programs, visualization
from hapticlink.fmus import cache
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization.browser_code import one_file
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.standalone import page

FOLDER = Path(__file__).parents[1] / "standalone"
MADE_FROM = "made_from.json"
"""In the folder: by scene, the hash of what its page was made from."""


def main(names: Sequence[str], folder: Path = FOLDER) -> list[str]:
    """Write the pages that are missing or out of date, and return the scenes whose page was
    written. A scene that cannot become a page is reported, and has none."""
    folder.mkdir(exist_ok=True)
    record = folder / MADE_FROM
    made = json.loads(record.read_text()) if record.exists() else {}
    written = []
    for i, name in enumerate(names, 1):
        path, scene = folder / f"{name}.html", load_viewed_scene(name)
        now = _made_from(scene)
        said = "as it was"
        if made.get(name) != now or not path.exists():
            try:
                page.write_page(scene, name, path)
            except InputFault as why:
                print(f"{i} of {len(names)}: {why}", flush=True)
                path.unlink(missing_ok=True)
                continue
            made[name], said = now, f"{path.stat().st_size / 1e3:.0f} kB"
            written.append(name)
            with atomic_file(record) as unfinished:
                unfinished.write_text(json.dumps(made, indent=1, sort_keys=True) + "\n")
        print(f"{i} of {len(names)}: {path}: {said}", flush=True)
    return written


def _made_from(scene: Scene) -> str:
    """The hash of all that a page depends on."""
    modules = [one_file.bundle(name) for name in ("worker.js", "sound_worklet.js")]
    packages = cache.sources(orchestrator, programs, analysis, visualization)
    scripts = [one_file.page("index.html", {}), *modules]
    return cache.key({"scene": repr(scene), "packages": packages, "scripts": scripts})


if __name__ == "__main__":
    main(sys.argv[1:] or list(hl.shipped()))
