"""A scene as it is linearised: read, built, in a pose, and without what has no slope."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.components.linkage.parameters import coordinates
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import built
from hapticlink.orchestrator.system.system import Fmu, System

Joints = Mapping[str, float | list[float]]
"""Joint coordinates (m, rad) as `linkage.start` has them."""


@contextmanager
def linearisable(
    scene: str | Path | Scene, options: Options = (), joints: Joints | None = None
) -> Iterator[tuple[Scene, System, list[str]]]:
    """The scene with `options`, its system without quantisation, friction and passivity
    controllers, and a line of text on each that was removed; with `joints`, at rest in that pose.
    Within the context signals are deferred, and numbers that overflow raise no warnings."""
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, options)
        with built(read) as whole:
            if joints is not None and read.linkage is not None:
                whole = at_rest(whole, read.linkage, joints)
            yield read, *frozen_nonlinearities.without(whole)


def at_rest(system: System, linkage: Linkage, joints: Joints) -> System:
    """The system whose linkage starts at rest in a pose, with the same FMU files in all poses: the
    start is a parameter of the mechanism and of its copy."""
    q = coordinates(linkage, joints)
    ports = {"q_start": q, "qd_start": [0.0] * len(q)}

    def started(fmu: Fmu) -> Fmu:
        for port, values in ports.items():
            scalars = fmu.description.port(port, "parameter")
            if len(scalars) == len(values):  # those of an FMU of others may be something else
                fmu = fmu.starting(tuple(zip(scalars, values, strict=True)))
        return fmu

    return replace(system, fmus=tuple(map(started, system.fmus)))
