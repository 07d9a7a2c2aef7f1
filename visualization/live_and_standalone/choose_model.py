"""The hold `model` as a choice of a page: which steps are taken when they begin and what the
graphics copy puts out are planned before the start, so that a scene begins anew with it."""

from __future__ import annotations

from hapticlink.analysis.search.settings import EARLY, HOLDS
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.signal_names import ENVIRONMENT
from hapticlink.orchestrator.scene.blocks import from_graphics
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.early_steps import why_late
from hapticlink.orchestrator.system.system import System

MODEL = "model"
"""The key of its control, and its name as a hold."""
OTHERWISE = ("hold=zoh", "downsampling=latest")
"""Where a scene that has it is to be without: the defaults of these keys."""


def has_model(scene: Scene) -> bool:
    """Whether the scene's default hold is `model`."""
    return scene.hold == MODEL


def options(scene: Scene, wanted: bool) -> tuple[str, ...]:
    """The options with which the scene has the hold `model`, or is without it."""
    early = scene.mechanism_at == "graphics"
    return HOLDS[EARLY if early else MODEL] if wanted else OTHERWISE


def with_model(scene: Scene, wanted: bool | None) -> Scene:
    """The scene with the hold `model`, or without it; as it is where neither is wanted (None)."""
    if wanted is None or wanted == has_model(scene):
        return scene
    return open_scene.load(scene, options(scene, wanted))


def can_have_model(scene: Scene, system: System) -> bool:
    """Whether a connection of the scene would go on by `model`: from a mechanism at the graphics
    rate whose steps can be taken when they begin, or from a graphics copy of this package that
    follows the mechanism's coordinates."""
    slower = [c for c in system.connections if c.hold and not c.initial]
    if scene.mechanism_at == "graphics":
        return any(why_late(c, scene, system.fmu, system.timeline) is None for c in slower)
    wanted = from_graphics(scene)
    return (
        (wanted.mobility or wanted.directions)
        and scene.graphics is not None
        and scene.graphics.sync != "operational"
        and all(fmu.replaces != ENVIRONMENT for fmu in scene.fmu)
        and any(c.source == ENVIRONMENT for c in slower)
    )
