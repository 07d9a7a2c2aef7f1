"""Plants whose steps are taken when they begin, in the loop: what the fast side gets of them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import hapticlink as hl
from hapticlink.analysis.findings.model_premises import describe_computing_times
from hapticlink.analysis.findings.summary import warnings
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import uses
from hapticlink.orchestrator.system.changes import check_change, choices, settable
from hapticlink.visualization.live_and_standalone.offered_controls import Offered
from tests.orchestrator.systems import system_of

AT_GRAPHICS = {
    "mechanism_at": "graphics",
    "directions_from": "mechanism",
    "controller.bias": "full",
    "controller.teleoperation.stiffness": [100.0, 100.0, 0.1],
    "controller.teleoperation.damping": [20.0, 20.0, 0.02],
}
MODEL = AT_GRAPHICS | {"hold": "model", "downsampling": "model"}
K, B = np.array([100.0, 100.0, 0.1]), np.array([20.0, 20.0, 0.02])
VARYING = {"min": 10, "max": 50, "seed": 3}


def run(tmp_path, **options):
    return hl.run(
        "closed-loop-ideal",
        MODEL | {"duration": 0.7} | options,
        out=tmp_path / "run",
        figures=False,
    )


def coupling(results, x, v, user=""):
    device = f"haptic_device{user}"
    return K * (x - results[f"{device}.x"]) + B * (v - results[f"{device}.v"])


@pytest.mark.parametrize("rate", [20, 30, VARYING])
def test_the_controller_gets_the_cubic_through_both_ends_of_each_frame(tmp_path, rate):
    """Its force between two frames is that of the poses of both, which only an early step knows."""
    r = run(tmp_path, **{"graphics.rate": rate})
    frames, x, v = (
        r.time("virtual_mechanism.x"),
        r["virtual_mechanism.x"],
        r["virtual_mechanism.v"],
    )
    cubic = CubicHermiteSpline(frames, x, v)
    ticks = r.time("controller.F_drift")
    known = ticks <= frames[-1]
    expected = coupling(r, cubic(ticks), cubic(ticks, 1))[known]
    np.testing.assert_allclose(r["controller.F_drift"][known], expected, atol=1e-9)
    assert np.abs(expected).max() > 0.01


@pytest.mark.parametrize(
    ("scene", "user", "point"), [("closed-loop-ideal", "", ""), ("two-users", "_left", "left.")]
)
def test_until_the_result_is_there_the_controller_goes_on_with_held_wrenches(scene, user, point):
    """With half a frame of computing time: the first half by the acceleration that the mechanism
    has with what it holds, the second by the cubic."""
    frame = 1 / 16
    options = {"graphics.rate": 16, "computing_time": frame / 2, "downsampling": "latest"}
    r = hl.run(scene, MODEL | {"duration": 0.7} | options, figures=False)
    force, mechanism = f"controller{user}.F_drift", f"virtual_mechanism.{point}"
    frames, ticks = r.time(f"{mechanism}x"), r.time(force)
    x, v = r[f"{mechanism}x"], r[f"{mechanism}v"]
    cubic = CubicHermiteSpline(frames, x, v)
    at = np.searchsorted(ticks, frames)
    held = r[f"hand{user}.F"][at] - r[force][at]
    mobility = r[f"{mechanism}Lambda_inv"].reshape(-1, 3, 3)
    a = np.einsum("tij,tj->ti", mobility, held) + r[f"{mechanism}a_bias"]
    since = np.clip(np.searchsorted(frames, ticks, "right") - 1, 0, len(frames) - 2)
    s = (ticks - frames[since])[:, None]
    early = (s > 0) & (s < frame / 2 - 1e-9)
    pose = np.where(early, x[since] + v[since] * s + a[since] * s**2 / 2, cubic(ticks))
    rate = np.where(early, v[since] + a[since] * s, cubic(ticks, 1))
    known = ticks <= frames[-1]
    found = r[force][known]
    np.testing.assert_allclose(found, coupling(r, pose, rate, user)[known], atol=1e-9)
    assert np.abs(found - coupling(r, cubic(ticks), cubic(ticks, 1), user)[known]).max() > 1e-4


def test_it_tracks_better_than_holds_that_guess():
    """Medium gains at 20 Hz: a sixth of the error of `foh`, which is the better of both."""
    errors = {}
    for hold in ("foh", "zoh", "model"):
        own = {"hold": hold, "downsampling": "model" if hold == "model" else "latest"}
        r = hl.run("closed-loop-ideal", AT_GRAPHICS | own | {"graphics.rate": 20}, figures=False)
        errors[hold] = r.tracking().distance_mm.max()
    assert 5 * errors["model"] < min(errors["foh"], errors["zoh"])


def test_what_model_stands_for_is_recorded(tmp_path):
    r = run(tmp_path)
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    holds = record["holds"]
    assert {holds[n] for n in holds if n.startswith("virtual_mechanism")} == {"ahead"}
    assert holds["controller.F_drift -> virtual_mechanism.F_drift"] == "mid"
    assert holds["hand.F -> virtual_mechanism.F_hand"] == "reaction"
    assert record["causal"] is True
    assert record["without_effect"] == []
    assert r.folder


def test_ages_are_those_of_the_end_of_the_step():
    options = [f"{k}={json.dumps(v)}" for k, v in MODEL.items()]
    system = system_of("closed-loop-ideal", *options, "duration=0.25", "graphics.rate=16")
    frame = system.timeline.clock("graphics").longest
    name = "virtual_mechanism.x -> controller.x_S"
    for use in uses(Plan(system), connections=[name]):
        ends = -(-use.tick // frame) * frame
        assert use.described == ends, use


def test_scenes_without_it_have_no_early_steps():
    for scene in ("closed-loop", "closed-loop-direct", "two-users"):
        assert not system_of(scene).early
    assert not system_of("closed-loop-ideal", "hold=model").early


def test_what_is_planned_before_the_start_cannot_be_changed_in_a_run():
    system = system_of("closed-loop-ideal", *(f"{k}={json.dumps(v)}" for k, v in MODEL.items()))
    for name, hold in (
        ("virtual_mechanism.x -> controller.x_S", "zoh"),
        ("controller.F_drift -> virtual_mechanism.F_drift", "latest"),
    ):
        c = system.connection[name]
        assert choices(system, c) == [c.hold]
        with pytest.raises(InputFault, match="planned before the start"):
            check_change(system, c, hold, None)
    with pytest.raises(InputFault, match="that of the start"):
        settable(system, "controller.K_pc")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (['coupling="gauss-seidel-plants"'], "does not hold the inputs of virtual_mechanism over"),
        (['holds."haptic_device.x"=ahead'], "haptic_device is not slower than"),
        (['holds."controller.F_drift"=ahead'], "controller is no plant"),
        (['holds."hand.F -> virtual_mechanism.F_hand"=mid'], "no force of a spring-damper"),
        (['holds."haptic_device.x"=reaction'], "acts no force of a spring-damper"),
        (
            ['holds."controller.F_drift"=mid', 'delays."controller.F_drift"=0.01'],
            "however late its samples are",
        ),
        (["hold=model", 'coupling="gauss-seidel-plants"'], "does not hold the inputs of virtual_m"),
        (["hold=model", 'get_after_set=["virtual_mechanism"]'], "get_after_set changes outputs"),
        (["computing_time=0.034", "graphics.rate=30"], "shortest step of virtual_mechanism is 0.0"),
        (["computing_time=0.05", "graphics.rate={min=10,max=50,seed=3}"], "take at most that"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(options, said):
    own = [f"{k}={json.dumps(v)}" for k, v in AT_GRAPHICS.items()]
    own_hold = any(hold in options[0] for hold in ("ahead", "mid", "model"))
    named = [] if own_hold else ["holds.virtual_mechanism.x=ahead"]
    with pytest.raises(InputFault) as refused:
        system_of("closed-loop-ideal", *own, *named, *options)
    assert said in str(refused.value)


def test_a_force_that_is_late_is_not_foretold():
    """`mid` has it by its ends of now, as if it were not late."""
    latency = 'delays."controller.F_drift"=0.05'
    options = [f"{k}={json.dumps(v)}" for k, v in MODEL.items()]
    name = "controller.F_drift -> virtual_mechanism.F_drift"
    for given, hold in (([], "mid"), ([latency], "half-lead")):
        system = system_of("closed-loop-ideal", *options, *given)
        assert system.connection[name].hold == hold
    system = system_of("closed-loop-ideal", *options)
    with pytest.raises(InputFault, match="however late its samples are"):
        check_change(system, system.connection[name], None, 0.01)


@pytest.mark.parametrize("port", ["x_S", "v_D", "Lambda_inv"])
def test_ends_of_a_force_that_is_foretold_are_not_disturbed(port):
    """`mid` would have them as they are, where the controller has them frozen."""
    at = [{"time": 0.2, "until": 0.3, "freeze": [f"controller.{port}"]}]
    with pytest.raises(InputFault, match="`mid` has the force"):
        hl.run("closed-loop-ideal", MODEL | {"at": at}, figures=False)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"downsampling": "model"}, "it is for efforts on plants whose steps are taken when they"),
        ({"computing_time": 0.01}, "computing_time acts on no connection: no step is taken when"),
        (
            {"hold": "model", "computing_time": 0.01, "delays": {"virtual_mechanism": 0.02}},
            "all connections from such steps have latencies of their own",
        ),
        ({"hold": "model", "computing_time": 0.01}, None),
    ],
)
def test_what_acts_on_nothing_is_told(options, said):
    if "delays" in options:
        ports = ("x", "v", "a_bias", "Lambda_inv", "P_c")
        options["delays"] = {f"virtual_mechanism.{port}": 0.02 for port in ports}
    r = hl.run("closed-loop-ideal", AT_GRAPHICS | {"duration": 0.1} | options, figures=False)
    lines = r.run["without_effect"]
    assert [said in line for line in lines] == ([True] if said else []), lines


def test_where_it_gains_less_is_told(tmp_path):
    arm = {"type": "arm", "stiffness": [300.0, 300.0, 0.0], "damping": [20.0, 20.0, 0.01]}
    start = {"target": [[0.0, 0.04452, 0.0148, -0.7878]]}
    cases = {
        "with encoders": {"sensing": "encoders"},
        "without Coriolis": {"controller.bias": "none"},
        "k lambda H^2 is 1.9": {"hand": arm | start, "graphics.rate": 10},
    }
    for said, options in cases.items():
        for hold, told in (("model", True), ("zoh", False)):
            own = MODEL | {"duration": 0.2, "hold": hold} | options
            r = hl.run("closed-loop-ideal", own, figures=False)
            lines = [line for line in warnings(r) if "gains less" in line]
            assert (len(lines), any(said in line for line in lines)) == (told, told), (said, lines)
    r = run(tmp_path, **{"hand": arm | start, "graphics.rate": 30})
    assert not any("gains less" in line for line in warnings(r))


@pytest.mark.parametrize(
    ("known", "took", "said"),
    [
        (0.0, 0.0019, None),
        (0.0, 0.004, "took 4 ms in the mean, and its result counts as there at once: take comp"),
        (0.01, 0.004, None),
        (0.01, 0.012, "counts as there after 10 ms: take computing_time = 0.02"),
        (0.0, 0.05, "take a lower graphics rate"),
    ],
)
def test_a_step_that_takes_longer_than_is_told_is_warned_of(known, took, said):
    """In real time alone, by the mean of what doStep took."""
    options = MODEL | {"duration": 0.2, "graphics.rate": 16, "computing_time": known}
    r = hl.run("closed-loop-ideal", options, figures=False)
    steps = r.record.calls["virtual_mechanism"]["step"]
    measured = replace(r.record.timings, steps={"virtual_mechanism": took * steps})
    record = replace(r.record, timings=measured)
    assert not [*describe_computing_times(record)]
    lines = [*describe_computing_times(replace(record, real_time={"period": 1 / 512}))]
    assert [said in line for line in lines] == ([True] if said else []), lines


def test_a_live_rate_leaves_time_for_the_result():
    """On a page, too, which offers no higher one."""
    options = MODEL | {"duration": 0.2, "graphics.rate": 16, "computing_time": 0.02}
    asked = []

    def turn(live):
        offered = Offered(live.scene, live.system).described({})
        asked.append(next(c["max"] for c in offered if c["key"] == "graphics.rate"))
        live.rate("graphics", 50)
        for rate, jitter in ((51, 0.0), (45, 0.2)):
            with pytest.raises(InputFault, match=r"there after 0.02 s .* take at most 50 Hz"):
                live.rate("graphics", rate, jitter)
        live.stop()

    hl.RealTime("closed-loop-ideal", options).run(turn)
    assert asked == [pytest.approx(50.0)]


def test_a_stiff_arm_is_not_fed_back_a_frame_late():
    """An arm of 300 N/m with a grip of 2000 N/m on firm gains at 20 Hz."""
    arm = {"type": "arm", "stiffness": [300.0, 300.0, 0.0], "damping": [24.0, 24.0, 0.01]}
    poses = [(0.038, -0.004), (0.062, 0.015), (0.031, 0.013), (0.059, 0.009), (0.027, 0.009)]
    path = [[0.0, 0.04452, 0.0148, -0.7878]]
    path += [[i / 2, x, y, -0.7878] for i, (x, y) in enumerate(poses, 1)]
    gains = {
        "controller.teleoperation.stiffness": [400.0, 400.0, 0.4],
        "controller.teleoperation.damping": [40.0, 40.0, 0.04],
    }
    options = MODEL | gains | {"hand": arm | {"target": path}, "graphics.rate": 20}
    errors = {}
    for hold in ("half-lead", "reaction"):
        own = {"holds": {"hand.F -> virtual_mechanism.F_hand": hold}}
        r = hl.run("closed-loop-ideal", options | own, figures=False)
        errors[hold] = r.tracking().distance_mm.max()
    assert 2 * errors["reaction"] < errors["half-lead"], errors
