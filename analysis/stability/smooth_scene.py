"""A scene as it is linearised: read, built, and without what has no slope."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import built
from hapticlink.orchestrator.system.system import System


@contextmanager
def linearisable(
    scene: str | Path | Scene, options: Options = ()
) -> Iterator[tuple[Scene, System, list[str]]]:
    """The scene with `options`, its system without quantisation, friction and passivity
    controllers, and a line of text on each that was removed. Within the context signals are
    deferred, and numbers that overflow raise no warnings."""
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, options)
        with built(read) as whole:
            yield read, *frozen_nonlinearities.without(whole)
