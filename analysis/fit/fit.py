"""Fits the device and the arm of a scene to a log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hapticlink.analysis.fit import log as logs
from hapticlink.analysis.fit.arm_fit import NAMES, fit_arm
from hapticlink.analysis.fit.device_fit import fit_device
from hapticlink.analysis.fit.estimate import Estimate
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import ArmHand
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.overrides import Options, toml
from hapticlink.orchestrator.scene.scene import Scene

COUNTING = 0.29
"""Root mean square (counts) of errors by counting alone, 1/sqrt(12)."""
ORIGIN = ((0.0, 0.0, 0.0, 0.0),)
DOUBTFUL = 0.05
"""The share of an axis's variance that the arm does not explain from which on its values are
doubted: docs/fit.md has what was found beyond."""


@dataclass(frozen=True)
class Fitted:
    """Estimates of [device] and [hand]. counts: root mean square of the errors that remain at the
    encoders; unexplained: by axis, the share of the variance of the hand's wrench that the arm does
    not explain. None and empty where there was nothing to fit. start: the handle's pose at the
    start of the log, which the hand keeps; left_out: what the log cannot say, in sentences."""

    estimates: tuple[Estimate, ...]
    counts: float | None
    unexplained: tuple[float, ...]
    arm: ArmHand
    start: tuple[float, ...]
    left_out: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        for estimate in self.estimates:
            known = "" if estimate.determined else ": not determined by this log"
            yield f"{estimate.text}{known}"
        if self.counts is not None:
            yield (
                f"errors at the encoders: {self.counts:.3g} counts rms, where counting alone makes "
                f"{COUNTING}"
            )
        if self.unexplained:
            shares = ", ".join(f"{share:.2%}" for share in self.unexplained)
            yield f"variance of the hand's wrench that the arm does not explain: {shares}"
        yield from self.left_out
        yield from self.warnings

    @property
    def warnings(self) -> Iterator[str]:
        """A line for each axis whose arm cannot be vouched for."""
        axes = dict.fromkeys(e.key[-2] for e in self.estimates if e.key.startswith("hand."))
        for axis, share in zip(axes, self.unexplained, strict=True):
            if share > DOUBTFUL:
                yield (
                    f"warning: the arm leaves {share:.0%} of axis {axis} unexplained, so that its "
                    "values are doubtful beyond their deviations: shake it by more encoder counts"
                )

    def record(self) -> dict[str, Any]:
        """The content of fit.json."""
        return {
            "parameters": {
                e.key: {**e.record(), "determined": e.determined} for e in self.estimates
            },
            "encoder_errors_counts": self.counts,
            "unexplained": list(self.unexplained),
            "left_out": list(self.left_out),
            "warnings": [*self.warnings],
        }

    def scene(self) -> str:
        """The tables [device] and [hand] of a scene with what the log determines, as text."""
        known = {e.key: e.value for e in self.estimates if e.determined}
        device = [f"{key.removeprefix('device.')} = {toml(v, key)}" for key, v in known.items()
                  if key.startswith("device.")]  # fmt: skip
        hand = []
        for name in NAMES:
            assumed = getattr(self.arm, name)
            values = [known.get(f"hand.{name}[{i}]", assumed[i]) for i in range(PLANE.size)]
            hand.append(f"{name} = {toml(values, name)}")
        lines = ["[device]", *device, ""] if device else []
        if self.unexplained:
            target = ((0.0, *self.start),)
            lines += ["[hand]", 'type = "arm"', *hand, f"target = {toml(target, 'target')}"]
        return "\n".join(lines) + "\n"


@one_blas_thread()
def fit(
    log: Path | str,
    scene: str | Path | Scene = "closed-loop",
    options: Options = (),
    *,
    device: Sequence[str] = (),
) -> Fitted:
    """Fits parameters of a device, by their keys in [device], and of the arm that holds it, to a
    log of its handle; all others are those of the scene, from whose values the search begins.

    log: a CSV, an HDF5 file or the folder of a run with the columns `time`, `haptic_device.x`
    (m, m, rad), and `controller.F_motor`, `hand.F` or both (N, N, N.m). Without the motors' wrench
    the arm alone is fitted, without the hand's the device alone, which nobody may then hold.
    In a run the hand's wrench is held over each haptic period, in other logs it acts all the time.
    Raises InputFault for a log that cannot be read or moves nothing, an unknown parameter, and a
    scene without a device.
    """
    read, given = open_scene.load(scene, options), logs.read_log(log)
    arm = read.hand if isinstance(read.hand, ArmHand) else ArmHand(target=ORIGIN)
    if read.device is None:
        raise InputFault("fit: the scene has no [device]")
    assert isinstance(read.device, Device)
    estimates: list[Estimate] = []
    counts: float | None = None
    unexplained: list[float] = []
    left_out: list[str] = []
    if given.motors is not None:
        found, counts = fit_device(given, read.device, device)
        estimates += found
    if given.hand is not None:
        if given.hand_type in ("", "arm"):
            found, unexplained = fit_arm(given, arm)
            estimates += found
            fitted = {e.key[-2] for e in found}
            left_out += [
                f"hand: axis {axis} is left out, where the log has no motion or no change of force"
                for axis in "012"
                if axis not in fitted
            ]
        else:
            left_out.append(f'hand: type = "{given.hand_type}" in this run, no arm to be fitted')
    if given.motors is None and given.hand is None:
        raise InputFault(f"{log}: it has neither the motors' nor the hand's wrench")
    if not estimates:
        raise InputFault(f"{log}: nothing to fit: {'; '.join(left_out)}")
    start = tuple(given.pose[0].tolist())
    return Fitted(tuple(estimates), counts, tuple(unexplained), arm, start, tuple(left_out))
