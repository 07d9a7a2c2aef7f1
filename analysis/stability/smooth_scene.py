"""A scene as it is linearised: with the quicker FMUs, in a pose, and without what has no slope."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.specs.linkage import Linkage, coordinates
from hapticlink.fmus import cache
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.native.compiler import compiler_version, host_platform
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.signal_names import DEVICE, OBSERVER
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.orchestrator.system.system import Fmu, System

Joints = Mapping[str, float | list[float]]
"""Joint coordinates (m, rad) as `linkage.start` has them."""


class StartPose(NamedTuple):
    """Where a linkage is, and the pose of the handle: None on the operational point."""

    joints: Joints
    handle: Sequence[float] | None = None


X_START = "x_start"
PLACED = {(DEVICE, X_START), (OBSERVER, X_START)}
"""The inputs that place the handle."""

MANY = 15_000
"""Places at which contacts are computed in a second. The verdict on `push-disc`, with 22,528, takes
41 s of processor time with native FMUs, whose compilation takes 14 s, and 66 s with Python ones;
that on `enclosure`, with 6,144, takes 11 s with either."""


@contextmanager
def linearisable(
    scene: str | Path | Scene, options: Options = (), at: StartPose | None = None
) -> Iterator[tuple[Scene, System, list[str]]]:
    """The scene with `options`, its system without quantisation, friction and passivity
    controllers, and a line of text on each that was removed; with `at`, at rest there.
    Within the context signals are deferred, and numbers that overflow raise no warnings."""
    with interrupt.defer_signals(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, options)
        with build_system(read) as whole:
            if at is not None and read.linkage is not None:
                whole = at_rest(whole, read.linkage, at)
            yield read, *frozen_nonlinearities.without(whole)


def with_quicker_fmus(read: Scene) -> Scene:
    """The scene with its own blocks as native FMUs, which give the same bits, where that saves more
    time than their compilation takes: MANY contacts, a compiler, and a cache that keeps them."""
    if read.linkage is None or read.contacts is None or cache.folder() is None:
        return read
    places = sum(pair.places for pair in near(read.linkage, read.contacts))
    if places * exact(read.haptics.rate) < MANY or not blocks(read).built:
        return read
    try:
        host_platform(), compiler_version()
    except FmuError:
        return read
    return open_scene.load(read, {"packaging": "native"})


def at_rest(system: System, linkage: Linkage, at: StartPose) -> System:
    """The system whose linkage starts at rest in a place, with the same FMU files in all of
    them: the start is a parameter of the mechanism, of its copy and of the device."""
    q = coordinates(linkage, at.joints)
    ports: dict[str, Sequence[float]] = {"q_start": q, "qd_start": [0.0] * len(q)}
    if at.handle is not None:  # what comes to the devices of further users stays
        ports[X_START] = at.handle
        brought = (c for c in system.connections if (c.target, c.target_port) not in PLACED)
        system = replace(system, connections=tuple(brought))

    def started(fmu: Fmu) -> Fmu:
        for port, values in ports.items():
            scalars = fmu.description.port(port, "parameter")
            if len(scalars) == len(values):  # those of an FMU of others may be something else
                fmu = fmu.starting(tuple(zip(scalars, values, strict=True)))
        return fmu

    return replace(system, fmus=tuple(map(started, system.fmus)))
