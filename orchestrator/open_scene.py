"""Opens a scene by its name or path: a shipped one, a TOML file, an SSP, an OspSystemStructure.xml,
or that of a run's state, which then goes on from it."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from hapticlink.orchestrator.base import plugins
from hapticlink.orchestrator.base.errors import Finding, InputFault, SceneFault
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.plan.schemes import SCHEMES as SCHEMES  # registers the schemes
from hapticlink.orchestrator.results.state_file import SUFFIX, expect_state, read_state
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.extends import document
from hapticlink.orchestrator.scene.find_scene import find_scene
from hapticlink.orchestrator.scene.hold_tables import write_hold_tables
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.read_and_check import from_source
from hapticlink.orchestrator.scene.scene import Scene, WrittenScene
from hapticlink.orchestrator.scene.scene_source import Source


def load(
    scene: str | FilePath | Scene | Source, options: Options = (), takes: Container[str] = ()
) -> Scene:
    """Find a scene, change it by `options` and check it.

    scene: the name of a shipped one, the path of a TOML file or SSP, a Scene, or a Source. A Scene
    that was read from a file is read again with its own options and the given ones; one that was
    created or changed in Python is checked. Raises SceneFault with every finding, InputFault for a
    scene that is not found, for an option that cannot be applied, and for a scene that begins
    otherwise than from its start values at 0 s, by keys that are not among those that it `takes`.
    """
    further = overrides.write_options(options)
    if isinstance(scene, Scene) and scene.source and not further:
        return require_start(scene, takes)
    source = scene if isinstance(scene, Source) else source_of(scene)
    source = replace(source, options=(*source.options, *further))
    if source.name.endswith((".ssp", ".xml")):
        _check_ssp(source)
    read = from_source(source)
    return require_start(read, takes)


def source_of(scene: str | FilePath | Scene) -> Source:
    """The tables of a scene, unchecked: what many variants of it are read from, without reading
    its files for each. Raises as `load` does."""
    plugins.load_installed()
    return _of(scene) if isinstance(scene, Scene) else _find(str(scene))


def _find(scene: str) -> Source:
    if scene.endswith(SUFFIX):
        with expect_state(FilePath(scene)):
            tables = read_state(FilePath(scene))["scene"]
            return Source(str(tables["title"]), tables | {"resume": scene}, {})
    if scene.endswith((".ssp", ".xml")):
        # Imported here, since their XML parsers are slow to load.
        from hapticlink.orchestrator.ssp import osp, read

        tables = (read if scene.endswith(".ssp") else osp).tables(FilePath(scene))
        return Source(scene, tables, {})
    name, text, folder = find_scene(scene)
    return Source(name, *document(text, name, folder))


def _of(scene: Scene) -> Source:
    if scene.source:
        return scene.source
    tables = write_tables(scene)
    if isinstance(scene, WrittenScene):
        return replace(scene.origin, tables=tables)
    return Source(scene.title, tables, {})


BEGINNINGS = ("resume", "start_time")
"""The keys by which a scene begins otherwise than from its start values at 0 s."""


def require_start(scene: Scene, takes: Container[str] = ()) -> Scene:
    """The scene. Raises InputFault for one that goes on from a state, or begins at another time
    than 0, by a key that is not among those that are taken."""
    if scene.resume and "resume" not in takes:
        raise InputFault(
            f"resume = {scene.resume!r}: runs and sweeps alone go on from a state, and not in real "
            "time: leave it out"
        )
    if scene.start_time and "start_time" not in takes:
        raise InputFault(
            f"start_time = {scene.start_time:g}: runs, sweeps and SSPs alone begin at another time "
            "than 0, and not in real time: leave it out"
        )
    return scene


def write_tables(scene: Scene) -> dict[str, Any]:
    """The tables of a scene as it is, which are read as those of a file."""
    tables: dict[str, Any] = adapter(Scene).dump_python(
        scene.plain(), mode="json", by_alias=True, exclude_none=True
    )
    write_hold_tables(tables)
    return tables


def _check_ssp(source: Source) -> None:
    from hapticlink.orchestrator.ssp import names

    keys = {overrides.parse(o)[0] for o in source.options}
    needed = [("duration", "3")] * ("duration" not in source.tables)
    needed += [("haptics.rate", "100")] * ("haptics" not in source.tables)
    if fixed := sorted(k for k in keys if names.is_fixed(k)):
        remedy = "the FMUs of an SSP are built already: change its scene and export it again"
        raise SceneFault(source.name, [Finding(".".join(k), remedy) for k in fixed])
    if missing := [n for n in needed if tuple(n[0].split(".")) not in keys]:
        remedy = "given neither by it nor by its FMUs' DefaultExperiment: add e.g. --set {}={}"
        raise SceneFault(source.name, [Finding(key, remedy.format(key, v)) for key, v in missing])
