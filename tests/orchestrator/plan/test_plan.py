"""Order of calls and causality of plans, without running an FMU."""

from bisect import bisect_right
from collections.abc import Callable
from fractions import Fraction
from itertools import islice

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.plan.event_kinds import keyed_events
from hapticlink.orchestrator.plan.operations import Event, Get, Push, Record, Set, Step
from hapticlink.orchestrator.plan.plan import Plan, moments
from hapticlink.orchestrator.plan.sample_ages import MAX_EVENTS, Delay, delays, pattern_end, uses
from hapticlink.orchestrator.plan.schemes import SCHEMES
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.system.timeline import timeline as timeline_of
from tests.orchestrator.systems import with_coupling
from tests.orchestrator.timelines import CAUSAL, fixed, scenes, varying

Make = Callable[[Timeline, str], System]
shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
timelines = st.one_of(
    st.builds(
        fixed,
        st.fractions(100, 1000, max_denominator=7),
        st.fractions(5, 100, max_denominator=7),
        st.integers(1, 120),
        st.sampled_from(["exact", "tick"]),
    ),
    st.builds(
        varying,
        st.just(Fraction(512)),
        st.just(Fraction(10)),
        st.just(Fraction(60)),
        st.integers(0, 99),
        st.integers(1, 200),
    ),
    scenes().map(timeline_of),
)
couplings = st.sampled_from(sorted(SCHEMES))


@shared
@given(timelines, couplings)
def test_no_get_after_set_without_a_step_between(stamped, timeline, coupling):
    plan = Plan(stamped(timeline, coupling))
    dirty: set[str] = set()
    for _, event in plan:
        for operation in plan.block(event):
            match operation:
                case Set(fmu):
                    dirty.add(fmu)
                case Step(fmu, _):
                    dirty.discard(fmu)
                case Get(fmu):
                    assert fmu not in dirty


def test_get_after_set_reads_and_pushes_what_the_new_inputs_give(stamped):
    """Once the step has ended, its feed-through outputs are those of the inputs of that instant."""
    plan = Plan(stamped(fixed(Fraction(100), Fraction(50), 10, "tick"), "jacobi"))
    plant = next(u.name for u in plan.system.fmus if not u.sampled and plan.system.into(u.name))
    plan = Plan(with_coupling(plan.system, get_after_set=(plant,)))
    event = next(e for _, e in plan if not e.first and any(
        f.clock == plan.system.fmu[plant].clock for f in e.firings))  # fmt: skip
    operations = plan.block(event)
    at = operations.index(Set(plant, now=True))
    pushed = [Push(c.name) for c in plan.system.out_of(plant) if c.hold]
    assert list(operations[at + 1 : at + 2 + len(pushed)]) == [Get(plant), *pushed]


@shared
@given(timelines, couplings)
def test_every_fmu_is_stepped_without_gap_or_overlap(stamped, timeline, coupling):
    plan = Plan(stamped(timeline, coupling))
    reached = dict.fromkeys(plan.system.fmu, 0)
    rows = {c.name: 0 for c in timeline.clocks}
    for tick, event in plan:
        assert tick <= timeline.end
        for operation in plan.block(event):
            if isinstance(operation, Step):
                assert reached[operation.fmu] == tick
                reached[operation.fmu] = tick + operation.dticks
            elif isinstance(operation, Record):
                rows[operation.table] += 1
    for unit in plan.system.fmus:
        assert (reached[unit.name] > timeline.end) == unit.sampled
    for clock in timeline.clocks:
        assert rows[clock.name] == sum(1 for start in clock.starts if start <= timeline.end)


@shared
@given(timelines, st.sampled_from(CAUSAL), st.sampled_from([{}, {"mechanism": 3}]))
def test_nothing_reads_the_future_and_holds_give_the_newest(stamped, timeline, coupling, substeps):
    """Of every clock: what it puts out is used at the first tick at or after its stamp, by plants,
    in all their substeps, and by sampled blocks. Jacobi's sampled outputs come an event later."""
    system = with_coupling(stamped(timeline, coupling), substeps=substeps)
    sources = {c.name: system.fmu[c.source] for c in system.connections}
    for tick, connection, stamp in uses(Plan(system)):
        assert stamp <= tick
        source = sources[connection]
        until = max(tick - 1, 0) if coupling == "jacobi" and source.sampled else tick
        starts = timeline.clock(source.clock).starts
        assert stamp == starts[bisect_right(starts, until) - 1]


@given(timelines, st.sampled_from([MAX_EVENTS, 40]))
def test_kinds_of_events_are_those_of_each_event(timeline, most):
    """In the order of their first occurrence, each with its events in order."""
    rows: dict[Event, list[int]] = {}
    every = [*islice(moments(timeline), most)]
    for i, (_, event) in enumerate(every):
        rows.setdefault(event, []).append(i)
    ticks, kinds = keyed_events(timeline, timeline.end, most)
    assert [*ticks] == [tick for tick, _ in every]
    assert [(kind, [*of]) for kind, of in kinds.items()] == [*rows.items()]


@shared
@given(timelines, couplings, st.sampled_from([MAX_EVENTS, 40]))
def test_ages_are_those_of_every_use(stamped, timeline, coupling, events):
    """From the end of all phases on, if the run gets there, until the pattern repeats or after so
    many events; then the causal ones stay within their bounds."""
    plan = Plan(stamped(timeline, coupling))
    ages, found, seconds = {}, delays(plan, events), timeline.seconds
    last = max(tick for tick, _ in islice(plan, events))
    used = list(uses(plan, min(pattern_end(plan.system), last)))
    begun = max(c.first if c.period and c.first < c.period else 0 for c in timeline.clocks)
    for tick, connection, stamp in used:
        if tick > (begun if begun < used[-1].tick else 0):
            ages.setdefault(connection, []).append(tick - stamp)
    assert found == {
        name: Delay(seconds(min(a)), seconds(max(a)), seconds(sum(a)) / len(a))
        for name, a in ages.items()
    }
    for tick, connection, stamp in uses(plan) if coupling in CAUSAL and events > 40 else ():
        if tick > begun:
            age = found[connection]
            assert age.min <= seconds(tick - stamp) <= age.max
