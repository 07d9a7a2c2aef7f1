"""A scene by its name or path: a shipped one, a TOML file, an SSP."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath

from hapticlink.orchestrator.base.faults import Finding, SceneFault
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.find import find, folder_of
from hapticlink.orchestrator.scene.load import from_tables, read
from hapticlink.orchestrator.scene.scene import Scene


def load(scene: str, options: Sequence[str] = ()) -> Scene:
    """Find, change by `options` (`key=value`) and check a scene: a file, a shipped one, an SSP."""
    if scene.endswith(".ssp"):
        # Its XML parsers take a while to load.
        from hapticlink.orchestrator.ssp import names
        from hapticlink.orchestrator.ssp import read as ssp

        data = ssp.tables(FilePath(scene))
        keys = {overrides.parse(o)[0] for o in options}
        needed = [("duration", "3")] * ("duration" not in data)
        needed += [("haptics.rate", "100")] * ("haptics" not in data)
        if fixed := sorted(k for k in keys if names.is_fixed(k)):
            say = "the FMUs of an SSP are made: change its scene and export that again"
            raise SceneFault(scene, [Finding(".".join(k), say) for k in fixed])
        if missing := [n for n in needed if tuple(n[0].split(".")) not in keys]:
            say = "neither it nor its FMUs' DefaultExperiment say: give e.g. --set {}={}"
            raise SceneFault(scene, [Finding(key, say.format(key, v)) for key, v in missing])
        return from_tables(data, options, scene, {})
    name, text = find(scene)
    return read(text, options, name, folder_of(scene))
