"""The points of the benchmark: settings of a scene, and the options that they stand for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

from benchmarks.continuous import CONTINUOUS, DETECTED, GRID
from hapticlink.components.integrators import METHODS
from hapticlink.orchestrator.holds import HOLDS
from studies.mismatch import design

LOOP, CONTACT = "closed-loop-ideal", "obstacles"
STUDY = design.REFERENCE
"""The rate (Hz) of the runs that the study of mismatched rates takes as continuous."""
NONE = "none"
"""In the place of a graphics rate and its hold: the mechanism's own matrices, nothing is held."""
RATES = (256, 512, 1024, 2048, 4096)
FRAMES = ("10", "30", "60", "240")
ITERATED = "iterated, hand a plant"


@dataclass(frozen=True, kw_only=True)
class Point:
    """rate: of the haptics (Hz). frames: the graphics rate (Hz), NONE if nothing is held.
    integrator and closing: of the mechanism. substeps and device_substeps: integration steps of the
    two plants per communication step. model: whether the mechanism has its own D, W, w and J_h."""

    scene: str = LOOP
    rate: int = 512
    frames: str = NONE
    hold: str = NONE
    integrator: str = "rk4"
    closing: str = "projection"
    scheme: str = "gauss-seidel"
    substeps: int = 1
    device_substeps: int = 1
    model: str = "own"

    @property
    def key(self) -> tuple[str, ...]:
        return tuple(str(getattr(self, f.name)) for f in fields(self))

    @property
    def options(self) -> list[str]:
        """Of the scene; rows hold the handle alone, on the grid of the reference."""
        found = [
            "packaging=native",
            "record.signals=['haptic_device.x_true']",
            f"record.every={self.rate // GRID}",
            f"haptics.rate={self.rate}",
            f"mechanism.integrator={self.integrator}",
            f"mechanism.substeps={self.substeps}",
            f"device.substeps={self.device_substeps}",
            f"coupling={self.scheme.split(',')[0]}",
        ]
        if self.scene == LOOP:
            found.append(f"mechanism.stabilization={self.closing}")
        if self.scheme == ITERATED:
            found += ["hand.timing=continuous", "iteration.method=newton"]
        if self.frames == NONE:
            found += [CONTINUOUS, DETECTED] if self.scene == CONTACT else [CONTINUOUS]
        else:
            found += [f"graphics.rate={self.frames}", f"hold={self.hold}"]
        if self.model == "held":
            found.append("local_model=true")
        return found

    def __str__(self) -> str:
        return f"{self.scene}, {', '.join(self.settings())}"

    def settings(self) -> Iterator[str]:
        """In words, as far as they differ from what is usual."""
        yield f"{self.rate} Hz"
        if self.frames != NONE:
            yield f"{self.hold} from {self.frames} Hz"
        if self.scheme != "gauss-seidel":
            yield self.scheme
        yield self.integrator + (f", {self.closing}" if self.closing != "projection" else "")
        if self.substeps > 1:
            yield f"{self.substeps} substeps"
        if self.device_substeps > 1:
            yield f"{self.device_substeps} substeps of the device"
        if self.model == "held":
            yield "local model"


def points(quick: bool = False) -> list[Point]:
    """All points once; `quick`, a few of each kind."""
    found = list(dict.fromkeys((*_loop(), *_contact())))
    return found[::23] if quick else found


def holds() -> list[str]:
    """The holds of slow signals for Lambda^-1 and P_c, which have no derivative and carry no
    power."""
    without = ("derivative", "power", "spring", "integral")
    return list(HOLDS.names(lambda kind: kind.needs not in without and not kind.downsamples))


def _loop() -> Iterator[Point]:
    plain = Point()
    yield from _vary([plain], rate=(*RATES, STUDY))
    yield from _vary([plain], rate=RATES[1:], frames=FRAMES, hold=("zoh",))
    yield from _vary([plain], rate=RATES[1:3], frames=FRAMES, hold=holds())
    bases = [plain, replace(plain, frames="60", hold="zoh")]
    yield from _vary(bases[:1], rate=RATES, integrator=METHODS.names())
    simple = ("semi-implicit-euler", "heun", "rk4")
    yield from _vary(bases[:1], rate=RATES, integrator=simple, closing=("baumgarte",))
    yield from _vary(bases, rate=RATES, scheme=("jacobi", "gauss-seidel-plants"))
    yield from _vary(bases, rate=RATES, substeps=(2, 4))
    yield from _vary(bases[:1], rate=RATES, device_substeps=(2, 4))
    local = replace(plain, model="held", closing="baumgarte", hold="zoh")
    cheap = ("semi-implicit-euler", "rk4")
    yield from _vary([local], rate=RATES[:4], frames=FRAMES[1:], integrator=cheap)


def _contact() -> Iterator[Point]:
    plain = Point(scene=CONTACT, substeps=2)
    held = replace(plain, hold="zoh", frames="60")
    yield from _vary([plain], rate=RATES, substeps=(1, 2, 4))
    yield from _vary([plain], rate=RATES[1:], frames=FRAMES[1:], hold=("zoh",))
    yield from _vary([plain], rate=RATES[1:3], frames=("60",), hold=("foh", "lead"))
    cheap = ("semi-implicit-euler", "heun", "passive-midpoint")
    yield from _vary([plain], rate=RATES, integrator=cheap)
    yield from _vary([plain, held], rate=RATES, scheme=("jacobi", "gauss-seidel-plants"))
    yield from _vary([plain], rate=RATES[:4], scheme=(ITERATED,))
    yield from _vary([plain], rate=RATES, device_substeps=(2,))
    yield from _vary([replace(held, model="held")], rate=RATES[1:], frames=FRAMES[1:])


def _vary(bases: Iterable[Point], **axes: Iterable[Any]) -> Iterator[Point]:
    for base, values in product(bases, product(*axes.values())):
        yield replace(base, **dict(zip(axes, values, strict=True)))
