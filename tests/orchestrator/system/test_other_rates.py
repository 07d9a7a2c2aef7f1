"""The system of a scene at other rates follows from one that is kept, where it is the same one."""

import gc
from dataclasses import replace

import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.plan.dependency_order import components
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays
from hapticlink.orchestrator.system import build_system as of
from hapticlink.orchestrator.system.system import System
from tests.orchestrator.run.test_kept_runs import nothing_kept

SCENE = "closed-loop-ideal"
RATES = [
    ("graphics.rate=45",),
    ("graphics.rate=17.3",),
    ("graphics.rate=17.3", "haptics.rate=777.5"),
    ("graphics.rate={ min = 20, max = 50, seed = 3 }",),
    ("graphics.rate=512",),
    ("graphics.rate=900",),  # faster than the haptics, whose connections then have the holds
]
FOLLOWS = [
    (),
    ("hold=foh",),
    ("graphics.align='tick'",),
    ("graphics.phase=0.01",),
    ("delays.'controller.x_D'=0.02",),
]
ASSEMBLED = [
    ("hold=model", "mechanism_at=graphics"),
    ("at=[{ time = 0.1, set = { 'hand.wrench' = [-0.1, 0.0, 0.0] } }]",),
    ("record.signals={ 'haptic_device.x' = 128.0 }",),
]


def build(*options: str, scene: str = SCENE) -> System | str:
    try:
        with of.build_system(open_scene.load(scene, options)) as system:
            return system
    except SceneFault as fault:
        return str(fault)


def told(system: System | str) -> object:
    """What it is, with the ticks of its clocks, which are not compared where they are computed."""
    if isinstance(system, str):
        return system
    clocks = [replace(clock, starts=tuple(clock.starts)) for clock in system.timeline.clocks]
    return replace(system, timeline=replace(system.timeline, clocks=tuple(clocks)))


@pytest.mark.parametrize("common", [*FOLLOWS, *ASSEMBLED])
def test_a_system_of_other_rates_is_the_one_that_is_assembled(
    common: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    with nothing_kept():
        alone = [build(*common, *rates) for rates in RATES]
    calls, assemble = list[int](), of._assemble
    monkeypatch.setattr(of, "_assemble", lambda *given: calls.append(1) or assemble(*given))
    with process_cache.keep_unpacked():
        kept = [build(*common, *rates) for rates in RATES]
        again = [build(*common, *rates) for rates in reversed(RATES)]
    assert [*map(told, kept)] == [*map(told, alone)]
    assert [*map(told, again)] == [*map(told, reversed(alone))]
    assert (len(calls) < sum(isinstance(each, System) for each in alone)) == (common in FOLLOWS)


@pytest.mark.parametrize("rates", [(4000, 64), (64, 4000)])
def test_a_step_that_is_too_long_is_refused_beside_one_that_is_not(rates: tuple[int, int]) -> None:
    options = "linkage.joint.0.friction_speed=1e-4", "duration=0.1"
    with process_cache.keep_unpacked():
        found = {r: build(*options, f"haptics.rate={r}", scene="pendulum") for r in rates}
    assert isinstance(found[4000], System)
    assert "too fast for steps of 0.0156 s" in str(found[64])


def test_plans_leave_nothing_that_waits_for_a_search_of_cycles() -> None:
    system = build("duration=0.2")
    assert isinstance(system, System)
    gc.collect()
    gc.disable()
    try:
        assert components({1: [2], 2: [1, 3], 3: []}) == [[3], [1, 2]]
        assert delays(Plan(system))
        assert gc.collect() == 0
    finally:
        gc.enable()
