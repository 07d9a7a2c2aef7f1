"""Latency and loss: no sample is used before it has arrived, and seeds are reproducible."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import uses
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.execute_plan import run
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.assign_holds import assign
from hapticlink.orchestrator.system.latency_and_loss import SampleLink
from hapticlink.orchestrator.system.system import EnergyPorts, System
from tests.orchestrator.plan.test_plan import timelines
from tests.orchestrator.systems import BARE
from tests.orchestrator.timelines import CAUSAL, fixed

LATE = "graphics.stamp -> controller.g"


def late(system: System, delays: dict[str, Latency], hold: str = "zoh") -> System:
    scene = replace(BARE, hold=hold, delays=delays)
    assigned, _ = assign(system.fmus, system.connections, system.timeline, scene, EnergyPorts())
    return replace(system, connections=assigned)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(
    timelines,
    st.sampled_from(CAUSAL),
    st.floats(0, 0.1),
    st.floats(0, 0.1),
    st.floats(0, 1),
    st.integers(0, 99),
)
def test_no_input_is_stamped_later_than_its_step_less_the_latency(
    stamped, timeline, coupling, least, spread, loss, seed
):
    drawn = Latency(min=least, max=least + spread, loss=loss, seed=seed)
    constant = Latency(min=least)
    delays = {LATE: drawn, "controller.stamp -> device.f": constant}
    system = late(stamped(timeline, coupling), delays)
    newest = dict.fromkeys((c.name for c in system.connections), 0)
    for tick, connection, stamp in uses(Plan(system)):
        assert newest[connection] <= stamp <= tick  # never back to an older one
        newest[connection] = stamp
        if connection in delays and stamp:
            assert (tick - stamp) * timeline.base >= Fraction(str(least))


@pytest.mark.parametrize("coupling", CAUSAL)
def test_what_the_plan_says_is_what_the_fmus_see(stamped, coupling):
    timeline = fixed(Fraction(512), Fraction(60), 256)
    drawn = Latency(min=0.01, max=0.05, loss=0.3, seed=4)
    delays = {LATE: drawn, "device.stamp": Latency(min=0.003)}
    system = late(stamped(timeline, coupling), delays)
    results = RunResults()
    outcome = run(Plan(system), results)
    table = results.tables()["haptics"]
    for name, column in ((LATE, "controller.seen_g"), ("device.stamp -> hand.d", "hand.seen_d")):
        said = [timeline.seconds(u.described) for u in uses(Plan(system)) if u.connection == name]
        np.testing.assert_allclose(table[column], said, rtol=0, atol=1e-12)
    # 3 ms are two ticks of 1/512 s, rounded up.
    seen = np.maximum(table["time"] - 2 / 512, 0.0)
    np.testing.assert_allclose(table["hand.seen_d"], seen, rtol=0, atol=1e-12)
    link = outcome.details.links[LATE]
    assert link.sent > link.lost > 0


@pytest.mark.parametrize("rate", [60, 30, 24, 10])
def test_extrapolated_stamps_are_the_time_itself(stamped, rate):
    """A stamp is a straight line: from exact ticks, first order gives it back at any rate, and
    with any latency."""
    timeline = fixed(Fraction(512), Fraction(rate), 256)
    for delays in ({}, {LATE: Latency(min=0.001, max=0.04, loss=0.2, seed=1)}):
        results = RunResults()
        run(Plan(late(stamped(timeline, "gauss-seidel"), delays, "foh")), results)
        table = results.tables()["haptics"]
        time, seen = table["time"], table["controller.seen_g"]
        started = int(np.argmax(seen > 0))
        assert started <= 512 // rate + 1 + (512 * 5 // rate if delays else 0)
        np.testing.assert_allclose(seen[started:], time[started:], rtol=0, atol=1e-12)


def test_loss_takes_its_share_and_a_seed_repeats():
    def kept(latency):
        link = SampleLink(latency, Fraction(1, 1000))
        for stamp in range(4000):
            link.send(stamp)
        return [stamp for _, stamp, _ in link.arrived(10**6)]

    lossy = Latency(loss=0.25, seed=3)
    assert kept(lossy) == kept(lossy) != kept(replace(lossy, seed=4))
    assert len(kept(lossy)) == pytest.approx(3000, abs=4 * np.sqrt(4000 * 0.25 * 0.75))
    assert len(kept(Latency(min=0.5))) == 4000


def test_a_scene_with_delays(tmp_path):
    """A late derivative goes with its sample."""
    options = [
        "duration=0.2",
        "delays.haptic_device.x=0.004",
        "delays.controller.F_motor={min=0.001, max=0.003, loss=0.1, seed=7}",
        "holds.virtual_mechanism.x=foh-derivative",
        "delays.virtual_mechanism.x={min=0.001, max=0.02, loss=0.3, seed=7}",
    ]
    run = simulate("closed-loop-direct", tmp_path, options).results.run
    assert run["latencies"]["haptic_device.x -> controller.x_D"]["min"] == 0.004
    assert run["delays"]["haptic_device.x -> controller.x_D"]["max"] == 3 / 512
    assert run["seeds"]["controller.F_motor -> haptic_device.F_motor"] == 7
    assert run["links"]["controller.F_motor -> haptic_device.F_motor"]["sent"] == 103
    name = "virtual_mechanism.x -> controller.x_S"
    assert run["holds"][name] == "foh-derivative"
    assert run["links"][name]["sent"] > run["links"][name]["lost"] > 0
