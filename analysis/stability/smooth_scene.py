"""A scene as it is linearised: with a short hyperperiod, built, in a pose, and without what has no
slope."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.lifted_map import hyperperiod
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.linkage.parameters import coordinates
from hapticlink.components.specs.linkage import Linkage
from hapticlink.fmus import cache
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.native.compiler import compiler_version, host_platform
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import built
from hapticlink.orchestrator.system.system import Fmu, System
from hapticlink.orchestrator.system.timeline import timeline

Joints = Mapping[str, float | list[float]]
"""Joint coordinates (m, rad) as `linkage.start` has them."""

EVENTS = 600
"""Haptic periods after which all has to repeat in a scene that is judged at its own rates."""
MANY = 15_000
"""Places at which contacts are computed in a second. The verdict on `push-disc`, with 22,528, takes
41 s of processor time with native FMUs, whose compilation takes 14 s, and 66 s with Python ones;
that on `enclosure`, with 6,144, takes 11 s with either."""


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


def short(read: Scene) -> tuple[Scene, str]:
    """The scene as it is judged, and which rate is rounded in it: where its events repeat only
    after more than EVENTS, as of 29.97 and 512 Hz after 100 s, frames are whole haptic periods.
    Raises InputFault for a rate that varies."""
    period = repetition(read)
    if read.graphics is None or period * float(read.haptics.rate) <= EVENTS:
        return read, ""
    return rounded(read)


def rounded(read: Scene) -> tuple[Scene, str]:
    """A scene that has a graphics rate in whole frames, and a sentence that says so. Raises
    InputFault for one that varies."""
    whole = float(exact(read.haptics.rate)) / frame_length(read)
    why = f"with its own rates all repeats only after {repetition(read):.4g} s"
    return whole_frames(read), f"judged with graphics at {whole:.5g} Hz: {why}"


def repetition(read: Scene) -> float:
    """The time (s) after which the events of all clocks of a scene repeat."""
    time = timeline(read)
    return time.seconds(hyperperiod(time))


def whole_frames(read: Scene) -> Scene:
    """The scene at the graphics rate next to its own with which frames are whole haptic periods.
    Raises InputFault for one that varies."""
    if read.graphics is None:
        return read
    rate = exact(read.haptics.rate) / frame_length(read)
    return open_scene.load(read, [f'graphics.rate="{rate}"'])


def frame_length(read: Scene) -> int:
    """Whole haptic periods next to a frame of the scene, which has a graphics rate. Raises
    InputFault for one that varies."""
    assert read.graphics is not None
    if not isinstance(read.graphics.rate, int | float | str):
        raise InputFault(
            "graphics.rate varies, so that there is no map of a period: take a fixed rate, such as "
            "--set graphics.rate=30"
        )
    return max(1, round(exact(read.haptics.rate) / exact(read.graphics.rate)))
