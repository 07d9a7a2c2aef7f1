"""The scene with the tuned gains, as a file that extends the original."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hapticlink.orchestrator.tune import Tuned


def tuned_scene(scene: str | Path, options: Sequence[str], tuned: Tuned) -> str:
    """The text of a TOML file: `extends`, the options that the scene was tuned with, the gains."""
    name = Path(str(scene))
    base = str(name.resolve()) if name.suffix == ".toml" else str(scene)
    head = [
        f'extends = "{base}"',
        f'title = "{tuned.title}, gains tuned to a margin of {tuned.asked:g}"',
    ]
    lines = [option.partition("=") for option in (*options, *tuned.options)]
    return "\n".join([*head, *(f"{key} = {value}" for key, _, value in lines), ""])
