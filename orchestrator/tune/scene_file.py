"""The scene with the tuned gains, as a file that extends the original."""

from __future__ import annotations

import json
from pathlib import Path

from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.tune.tuned import Tuned


def tuned_scene(scene: str | Path, tuned: Tuned) -> str:
    """The text of a TOML file: `extends`, the options that the scene was tuned with, the gains."""
    name = Path(str(scene))
    lines = {
        "extends": str(name.resolve()) if name.suffix == ".toml" else str(scene),
        "title": f"{tuned.title}, gains tuned to a margin of {tuned.asked:g}",
    }
    for option in (*tuned.given, *tuned.options):
        names, value = overrides.parse(option)
        lines[".".join(n if n.isidentifier() else json.dumps(n) for n in names)] = value
    return "".join(f"{key} = {overrides.toml(value, key)}\n" for key, value in lines.items())
