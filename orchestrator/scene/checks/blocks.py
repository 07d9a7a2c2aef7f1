"""Checks that blocks have the tables they depend on: local model, packaging, controller, hand, and
further points; each yields (path, message)."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.scene.blocks import Blocks, driver_of, from_graphics
from hapticlink.orchestrator.scene.checks.linkage import points
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, path_of_user


def check_blocks(scene: Scene, blocks: Blocks) -> Iterator[Problem]:
    yield from points(scene)
    if scene.packaging == "native" and not blocks.built:
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

    if scene.linkage and scene.linkage.closed and scene.mechanism.stabilization == "projection":
        yield (
            ("mechanism", "stabilization"),
            "'projection' factors the mechanism's own matrices at every step, which the local "
            "model is there to save: take 'baumgarte'",
        )


def check_needed_tables(scene: Scene) -> Iterator[Problem]:
    """A problem for each table that needs another one which is missing."""
    if not scene.linkage and not scene.device and not scene.fmu:
        yield ("linkage",), "nothing to simulate: give a [linkage], a [device] or an [[fmu]]"
    if not scene.linkage:
        for table in ("graphics", "controller"):
            if getattr(scene, table) and not (table == "graphics" and scene.fmu):
                yield (table,), f"[{table}] needs a [linkage]: add one, or take [{table}] out"
    if scene.controller and not scene.device:
        yield ("controller",), "[controller] moves a device: add [device], or take it out"
    if scene.hand and not scene.device and not scene.linkage:
        yield ("hand",), "[hand] holds a device or a linkage: add one, or take it out"
    if scene.sensing == "encoders" and not scene.device:
        yield ("sensing",), "'encoders' are the device's: add [device], or take sensing out"
    yield from _observers(scene)
    yield from _boards(scene)
    if not scene.graphics:
        if scene.mechanism_at == "graphics":
            yield ("mechanism_at",), "there is no graphics rate: add [graphics] with its rate"
        wanted = from_graphics(scene)
        if wanted.mobility or wanted.directions:
            yield (
                ("directions_from",),
                "the controller needs Lambda_inv and P_c: add [graphics], or take "
                "directions_from = 'mechanism'",
            )


SLOWEST_BOARD = 200.0
"""Haptic rate (Hz) with a board: torques are zero within a tick, at most 5 ms, of a signal."""


def _boards(scene: Scene) -> Iterator[Problem]:
    """A problem for each board of which torques and angles would not be those of its device."""
    for user, device in scene.all_devices.items():
        if not driver_of(scene, user):
            continue
        table = path_of_user("device", user)
        if scene.sensing != "encoders":
            yield ("sensing",), "a board has encoders: take sensing = 'encoders'"
        elif not device.observer.beside:
            message = "a board has no observer in it: take beside = true"
            yield (*table, "observer", "beside"), message
        rate = scene.haptics.rate
        if isinstance(rate, float | int) and rate < SLOWEST_BOARD:
            message = (
                f"{rate:g} Hz: a board is to be without torque within 5 ms of a signal, which is "
                f"looked for once a tick: take {SLOWEST_BOARD:g} Hz or more"
            )
            yield ("haptics", "rate"), message


def _observers(scene: Scene) -> Iterator[Problem]:
    """A problem for each observer that is asked for beside a device whose sensing is ideal, and for
    each key of a law that its observer does not have."""
    for user, device in scene.all_devices.items():
        spec = device.observer
        table = (*path_of_user("device", user), "observer")
        if scene.sensing == "ideal" and spec.beside:
            message = (
                "true, and with sensing = 'ideal' nothing is observed: take sensing = 'encoders', "
                "or take it out"
            )
            yield (*table, "beside"), message
        for key in ("rule", "k_D") if spec.law == "kalman" else ():
            if getattr(spec, key) != getattr(type(spec)(), key):
                message = "is of law = 'nicosia', and law = 'kalman' has no such key: take it out"
                yield (*table, key), message
