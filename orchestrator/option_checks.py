"""What further hands, the local model and `packaging` need; each yields (path, message)."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.blocks import blocks
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.toml_lines import Path

Problem = tuple[Path, str]


def check(scene: Scene) -> Iterator[Problem]:
    yield from _points(scene)
    if scene.packaging == "native" and not blocks(scene):
        message = (
            "'native' compiles the scene's own blocks, and every FMU here is ready: take it out"
        )
        yield ("packaging",), message
    if not scene.local_model:
        return
    here: Path = ("local_model",)
    if not scene.linkage:
        yield here, "there is no mechanism to model: add [linkage]"
    if not scene.graphics:
        yield here, "its matrices come at the graphics rate: add [graphics]"
    if scene.mechanism_at == "graphics":
        yield here, "the mechanism runs at the graphics rate itself: take mechanism_at out"

    if scene.linkage and scene.linkage.loop and scene.mechanism.stabilization == "projection":
        yield (
            ("mechanism", "stabilization"),
            "'projection' factors the mechanism's own matrices at every step, which the local "
            "model is there to save: take 'baumgarte'",
        )


def _points(scene: Scene) -> Iterator[Problem]:
    points = scene.linkage.point if scene.linkage else ()
    bodies = [b.name for b in scene.linkage.body] if scene.linkage else []
    names: set[str] = {"operational_point"}
    for i, point in enumerate(points):
        path: Path = ("linkage", "point", i)
        if point.name in names:
            yield (*path, "name"), f"{point.name!r} is taken: name each point once"
        if not point.name.isidentifier():
            yield (*path, "name"), f"{point.name!r}: a name of letters, digits and _"
        names.add(point.name)
        if point.body not in bodies:
            yield (*path, "body"), f"no body {point.body!r}; there are {', '.join(bodies)}"
    for name in scene.hands:
        if name not in names - {"operational_point"}:
            known = ", ".join(sorted(names - {"operational_point"})) or "none"
            yield (
                ("hands", name),
                f"no point {name!r}; there are {known}: add it as [[linkage.point]]",
            )
