"""The runs of the study, and the continuous runs that they are compared with."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.sweep.job import Job, job

RATES = ("10", "20", "24", "30", "40", "50", "60")
VARIABLE = "10..60"
SEEDS = (1, 2, 3)
BIAS = ("none", "full")
SYNC = ("operational", "joint")
MODELS = {
    "own": ("local_model=false",),
    "held": ("local_model=true", "mechanism.stabilization=baumgarte"),
}
"""The D, W, w and J_h of the mechanism: its own, or those held from the last frame (B.15)."""
REFERENCE, FLOOR = 8192, 4096
"""Rates (Hz) of the runs taken as continuous, and of those that estimate their error."""

PRINTED = "printed"
GAINS: dict[str, tuple[str, ...]] = {
    PRINTED: (
        "controller.teleoperation.stiffness=[100.0, 100.0, 0.5]",
        "controller.teleoperation.damping=[70.0, 70.0, 0.375]",
    ),
    "weaker": (
        "controller.teleoperation.stiffness=[100.0, 100.0, 0.1]",
        "controller.teleoperation.damping=[20.0, 20.0, 0.02]",
    ),
}
"""K_pc and B_pc: those of section B.6, and those of the scene closed-loop-direct."""

MEANS = ("zoh", "foh", "foh-derivative")
"""Holds that are also tried with the mean over the slow step in the other direction."""
GUARDED = ("foh-derivative", "pspm")
"""Holds of poses that are also tried with `passive` on the wrenches in the other direction."""
WRENCHES = ("virtual_mechanism.F_hand", "virtual_mechanism.F_drift")


def jobs() -> list[Job]:
    """All runs, the references first."""
    return [*_references(), *_direct(), *_closed_loop()]


def _references() -> Iterator[Job]:
    """All blocks at one high rate, with the mechanism's own Lambda^-1: nothing is held."""
    for gains, bias, rate in product(GAINS, BIAS, (REFERENCE, FLOOR)):
        options = ["directions_from=mechanism", f"haptics.rate={rate}", f"controller.bias={bias}"]
        point = {"scene": "continuous", "gains": gains, "bias": bias, "rate": str(rate)}
        yield job("closed-loop", [*options, *GAINS[gains]], point)


def _closed_loop() -> Iterator[Job]:
    """Lambda^-1 and P_c cross from the graphics rate; no power crosses rates."""
    holds = _holds(("derivative", "power", "spring"))
    for model, sync, bias, hold, (rate, seed, option) in product(
        MODELS, SYNC, BIAS, holds, _rates()
    ):
        options = [*holds[hold], option, f"graphics.sync={sync}", f"controller.bias={bias}"]
        point = {"gains": PRINTED, "model": model, "sync": sync, "bias": bias, "hold": hold}
        point = {"scene": "closed-loop", **point, "rate": rate, "seed": seed}
        yield job("closed-loop", [*options, *MODELS[model]], point)


def _direct() -> Iterator[Job]:
    """The mechanism runs at the graphics rate: wrenches, poses and velocities cross rates."""
    holds = _holds(())
    for gains, bias, hold, (rate, seed, option) in product(GAINS, BIAS, holds, _rates()):
        options = [*holds[hold], option, f"controller.bias={bias}", *GAINS[gains]]
        point = {"gains": gains, "bias": bias, "hold": hold, "rate": rate, "seed": seed}
        yield job("closed-loop-direct", options, {"scene": "closed-loop-direct", **point})


def _holds(without: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Options of each hold from slow to fast, except for holds with the needs `without`, and for
    `slope`, which belongs to the velocity of a pose that another hold holds."""
    apart = (*without, "integral")
    names = HOLDS.names(lambda kind: kind.needs not in apart and not kind.downsamples)
    found: dict[str, tuple[str, ...]] = {n: (f"hold={n}",) for n in names}
    means = {f"{n}, mean": (*found[n], "downsampling=mean") for n in MEANS if n in found}
    passive = tuple(f"holds.{wrench}=passive" for wrench in WRENCHES)
    guarded = {f"{n}, passive": (*found[n], *passive) for n in GUARDED if n in found}
    return {**found, **means, **guarded}


def _rates() -> Iterator[tuple[str, str, str]]:
    """Rate, seed ("" for a fixed rate) and option of each graphics rate."""
    for rate in RATES:
        yield rate, "", f"graphics.rate={rate}"
    low, high = VARIABLE.split("..")
    for seed in SEEDS:
        bounds = f"{{ min = {low}, max = {high}, seed = {seed} }}"
        yield VARIABLE, str(seed), f"graphics.rate={bounds}"
