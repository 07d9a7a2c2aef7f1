"""Timelines of one clock, of two, and of scenes whose FMUs have rates and phases of their own."""

from collections.abc import Mapping
from fractions import Fraction
from itertools import accumulate

from hypothesis import strategies as st

from hapticlink.orchestrator.base.ticks import (
    Clock,
    Timeline,
    align_to_ticks,
    common_base,
    exact,
    periodic,
    variable,
)
from hapticlink.orchestrator.scene.rates import AnyRate, VariableRate
from hapticlink.orchestrator.scene.scene import Haptics, Scene
from hapticlink.orchestrator.scene.scene_tables import ForeignFmu

CAUSAL = ("gauss-seidel", "jacobi")
"""Schemes in which nobody reads a value stamped later than the start of its step."""


def fixed(haptics: Fraction, graphics: Fraction, steps: int, align: str = "exact") -> Timeline:
    fast, slow = 1 / haptics, 1 / graphics
    base = common_base([fast, slow]) if align == "exact" else fast
    end = steps * int(fast / base)
    frames = periodic(slow, base, end) if align == "exact" else align_to_ticks(slow, base, end)
    return Timeline(
        base, end, (Clock("haptics", periodic(fast, base, end)), Clock("graphics", frames))
    )


def varying(haptics: Fraction, low: Fraction, high: Fraction, seed: int, steps: int) -> Timeline:
    base = 1 / haptics
    frames = variable(low, high, seed, base, steps)
    return Timeline(
        base, steps, (Clock("haptics", periodic(base, base, steps)), Clock("graphics", frames))
    )


LOOP = ("device", "controller", "hand", "mechanism", "graphics")
"""The FMUs of the loop of stamps (conftest)."""


def scene_of(
    haptics: Fraction, steps: int, rates: Mapping[str, AnyRate], shares: Mapping[str, Fraction]
) -> Scene:
    """A scene of FMUs at `rates`; those at fixed ones with phases that are `shares` of a period."""
    fixed = {n: haptics if r == "haptics" else r for n, r in rates.items()}
    phases = {
        name: str(share / exact(rate))
        for name, share in shares.items()
        if not isinstance(rate := fixed[name], VariableRate | tuple)
    }
    return Scene(
        title="rates and phases",
        duration=float(steps / haptics),
        haptics=Haptics(rate=str(haptics)),
        fmu=tuple(ForeignFmu(name=name, path="", rate=rate) for name, rate in rates.items()),
        phases=phases,
    )


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """The loop's FMUs at the haptic rate, at others, at rates that vary and at given times."""
    haptics = draw(st.fractions(100, 1000, max_denominator=7))
    steps = draw(st.integers(1, 60))
    gaps = st.lists(st.integers(20, 80), min_size=30, max_size=30)  # ms, more than two ticks
    rate = st.one_of(
        st.just("haptics"),
        st.fractions(20, 1000, max_denominator=7).map(str),
        st.builds(VariableRate, min=st.just(10), max=st.just(60), seed=st.integers(0, 99)),
        gaps.map(lambda ms: tuple(total / 1000 for total in accumulate(ms))),
    )
    rates = {name: draw(rate) for name in LOOP}
    share = st.fractions(Fraction(1, 9), 1, max_denominator=9)
    moved = draw(st.sets(st.sampled_from(LOOP)))
    return scene_of(haptics, steps, rates, {name: draw(share) for name in sorted(moved)})
