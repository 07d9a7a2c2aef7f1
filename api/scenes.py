"""Scenes before they run: lists, reads and explains them."""

from __future__ import annotations

from pathlib import Path

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.plan import explain as explained
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run.fetched_outputs import choose_fetched
from hapticlink.orchestrator.scene import find_scene
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import build_system


def shipped() -> dict[str, str]:
    """The names of the scenes that are shipped with hapticlink, each with its title."""
    return {name: open_scene.load(name).title for name in find_scene.list_shipped()}


def scene(scene: str | Path | Scene, options: Options = ()) -> Scene:
    """Read and check a scene: the name of a shipped one, or the path of a scene file or an SSP.

    `options` change it, as a mapping of dotted keys to values,
    `{"graphics.rate": 10, "holds.virtual_environment.P_c": "lead"}`, or as on the command line,
    `["graphics.rate=10"]`. Values are numbers, booleans, text, lists, NumPy arrays and tables
    (mappings), which replace those of the scene. Every function that takes a scene takes such
    options, and accepts a Scene in place of a name. A Scene keeps its origin, so that options can
    be applied again and faults name lines of the file.

    Raises SceneFault with all findings at once, InputFault for an option that cannot be applied.
    """
    return open_scene.load(scene, options, takes=open_scene.BEGINNINGS)


def explain(scene: str | Path | Scene, options: Options = ()) -> list[str]:
    """The plan of a run as lines of text: which FMU steps when, and from which samples its inputs
    are computed. Raises InputFault for a scene that cannot be run.
    """
    with build_system(open_scene.load(scene, options, takes=open_scene.BEGINNINGS)) as system:
        return list(explained.explain(Plan(choose_fetched(system)), explained.PRINTED))
