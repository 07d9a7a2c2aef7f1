"""Plants whose steps are taken when they begin, in the loop: what the fast side gets of them."""

import json

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import hapticlink as hl
from hapticlink.analysis.findings.summary import warnings
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import uses
from hapticlink.orchestrator.system.changes import check_change, choices, settable
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


def coupling(results, x, v):
    return K * (x - results["haptic_device.x"]) + B * (v - results["haptic_device.v"])


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


def test_until_the_result_is_there_the_controller_goes_on_with_held_wrenches(tmp_path):
    """With half a frame of computing time: the first half by the acceleration that the mechanism
    has with what it holds, the second by the cubic."""
    frame = 1 / 16
    options = {"graphics.rate": 16, "computing_time": frame / 2, "downsampling": "latest"}
    r = run(tmp_path, **options)
    frames, ticks = r.time("virtual_mechanism.x"), r.time("controller.F_drift")
    x, v = r["virtual_mechanism.x"], r["virtual_mechanism.v"]
    cubic = CubicHermiteSpline(frames, x, v)
    at = np.searchsorted(ticks, frames)
    held = r["hand.F"][at] - r["controller.F_drift"][at]
    mobility = r["virtual_mechanism.Lambda_inv"].reshape(-1, 3, 3)
    a = np.einsum("tij,tj->ti", mobility, held) + r["virtual_mechanism.a_bias"]
    since = np.clip(np.searchsorted(frames, ticks, "right") - 1, 0, len(frames) - 2)
    s = (ticks - frames[since])[:, None]
    early = (s > 0) & (s < frame / 2 - 1e-9)
    pose = np.where(early, x[since] + v[since] * s + a[since] * s**2 / 2, cubic(ticks))
    rate = np.where(early, v[since] + a[since] * s, cubic(ticks, 1))
    known = ticks <= frames[-1]
    found = r["controller.F_drift"][known]
    np.testing.assert_allclose(found, coupling(r, pose, rate)[known], atol=1e-9)
    assert np.abs(found - coupling(r, cubic(ticks), cubic(ticks, 1))[known]).max() > 1e-4


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
    assert holds["hand.F -> virtual_mechanism.F_hand"] == "half-lead"
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
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(options, said):
    own = [f"{k}={json.dumps(v)}" for k, v in AT_GRAPHICS.items()]
    named = (
        [] if "ahead" in options[0] or "mid" in options[0] else ["holds.virtual_mechanism.x=ahead"]
    )
    with pytest.raises(InputFault) as refused:
        system_of("closed-loop-ideal", *own, *named, *options)
    assert said in str(refused.value)


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
