from __future__ import annotations

from pathlib import Path

from hapticlink.commands.options import Out, Scene, Set
from hapticlink.orchestrator.base.terminal_output import say


def export(scene: Scene, /, *, out: Out = None, set: Set = None) -> int:
    """Write a scene as OUT/SCENE.ssp (default ssp/): its FMUs and connections for other tools;
    `hapticlink run` reads it back, rates and holds included.

    For example:

        hapticlink export closed-loop --out ssp
    """
    import hapticlink as hl

    say(hl.export(scene, set or (), out=(out or Path("ssp")) / f"{Path(scene).stem}.ssp"))
    return 0
