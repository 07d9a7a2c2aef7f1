"""Draws and candidates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from hapticlink.analysis.search.settings import GAINS
from hapticlink.analysis.sweep.job import Job, job
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene
from studies.mismatch.cases import Case
from studies.observer import tried_observer

RATES = (10, 20, 30)
LINKAGES = ("five-bar", "four-bar", "serial")
PRESENT, KALMAN, IDEAL = "report: omega_n 50, k_D 100", "kalman", "ideal sensing"
COMMON = ("packaging=native", "hold=model", "controller.bias=full", "duration=3.0",
          "mechanism.stabilization=projection", "sensing=encoders")  # fmt: skip
_EXACT_WRENCH = {
    "connection": [
        {"from": "hand.F", "to": target}
        for target in ("controller.F_hand", "virtual_mechanism.F_hand")
    ]
}
_EXACT_MOTION = {
    "connection": [
        {"from": "haptic_device.x_true", "to": "controller.x_D"},
        {"from": "haptic_device.v_true", "to": "controller.v_D"},
    ]
}


def _nicosia(omega_n: float) -> dict[str, Any]:
    return {"device.observer.omega_n": omega_n, "device.observer.k_D": 2 * omega_n}


_LAW = {"device.observer.law": "kalman"}
JUDGED: dict[str, dict[str, Any]] = {
    PRESENT: {},
    "report's, 100, 200": _nicosia(100.0),
    KALMAN: _LAW,
    "report's, hand's wrench exact": _EXACT_WRENCH,
    "kalman, hand's wrench exact": _LAW | _EXACT_WRENCH,
    "report's, motion exact": _EXACT_MOTION,
    "kalman, motion exact": _LAW | _EXACT_MOTION,
    IDEAL: {"sensing": "ideal"},
}
"""Options of what is compared on the draws kept apart. With the hand's wrench exact, controller and
mechanism get it as it is; with the motion exact the controller gets pose and velocity so."""
SENSED = (PRESENT, "report's, 100, 200", KALMAN, IDEAL)
"""What is run at all rates, floors at one."""
FLOORS_AT = 20
TRIED: dict[str, dict[str, Any]] = {
    PRESENT: {},
    **{f"report's, {w}, {2 * w}": _nicosia(float(w)) for w in (75, 100, 150)},
    **{f"kalman, {w}": _LAW | {"device.observer.omega_n": float(w)} for w in (80, 119, 160)},
    "kalman, 119, order 4": tried_observer.options(119.0, order=4),
    "kalman, 80, order 4": tried_observer.options(80.0, order=4),
    "kalman, 119, dead zone of half a count": tried_observer.options(119.0, dead_zone=0.5),
    "kalman, 70, impulse kept": tried_observer.options(70.0, impulse=1.0),
    "kalman, 119, grip of 2000 N/m predicted": tried_observer.options(119.0, grip=2000.0),
    IDEAL: {"sensing": "ideal"},
}
"""What was tried on the draws that it was tuned on."""
DEVICES: dict[str, dict[str, Any]] = {
    "as assumed": {},
    "four times the counts": {"device.encoder.resolution": 0.0015707963267948966 / 4},
    "a third of the mass": {
        f"device.{name}": value / 3
        for name, value in (
            ("body.a_left_proximal.mass", 0.05), ("body.a_left_proximal.inertia", 1.07e-4),
            ("body.a_left_distal.mass", 0.035), ("body.a_left_distal.inertia", 1.17e-4),
            ("body.crank.mass", 0.12), ("body.crank.inertia", 8e-5), ("motor.inertia", 1.4e-5),
        )
    },
    "1024 Hz": {"haptics.rate": 1024},
}  # fmt: skip
ON_DEVICES = (PRESENT, KALMAN, "kalman, 119")


@dataclass(frozen=True)
class Draw:
    """A case at a graphics rate (Hz) with gains."""

    case: Case
    rate: int
    gains: str


def tuned() -> Iterator[Draw]:
    k = 0
    for linkage in LINKAGES:
        for hand in ("constant", "profile", "arm 100", "arm 1000"):
            for _ in range(2):
                yield Draw(Case(linkage, hand, False, 44001 + k), RATES[k % 3], "medium")
                k += 1


def kept_apart() -> Iterator[Draw]:
    k = 0
    for linkage in (*LINKAGES, "slider-crank"):
        for hand in ("constant", "profile", "arm 300", "spring 200"):
            for _ in range(2):
                case = Case(linkage, hand, False, 44501 + k)
                yield from (Draw(case, rate, gains) for rate in RATES for gains in GAINS)
                k += 1


def on_devices() -> Iterator[Draw]:
    k = 0
    for linkage in ("five-bar", "slider-crank"):
        for hand in ("constant", "spring 200"):
            yield Draw(Case(linkage, hand, False, 44601 + k), 20, "medium")
            k += 1


def jobs() -> list[Job]:
    """All runs."""
    found = [_job("tuned", draw, name, of) for draw in tuned() for name, of in TRIED.items()]
    for draw in kept_apart():
        of_draw = JUDGED if draw.rate == FLOORS_AT else {name: JUDGED[name] for name in SENSED}
        found += [_job("kept apart", draw, name, of) for name, of in of_draw.items()]
    every = JUDGED | TRIED
    for device, own in DEVICES.items():
        for draw in on_devices():
            found += [_job(device, draw, name, own | every[name]) for name in ON_DEVICES]
    return found


def _job(part: str, draw: Draw, candidate: str, options: dict[str, Any]) -> Job:
    case = draw.case
    every = [*COMMON, *case.options, *GAINS[draw.gains], f"graphics.rate={draw.rate}"]
    every += overrides.write_options(options)
    point = {"part": part, "case": case.name, "seed": str(case.seed), "rate": str(draw.rate)}
    return job(_read(case.scene), every, point | {"gains": draw.gains, "observer": candidate})


@cache
def _read(scene: str) -> Scene:
    """A scene whose files are read once."""
    return open_scene.load(scene)
