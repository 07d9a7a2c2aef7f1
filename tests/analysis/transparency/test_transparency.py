"""What is felt, against closed forms, and against runs of the FMUs in a hand that shakes or presses
the handle."""

from __future__ import annotations

from dataclasses import replace
from functools import partialmethod
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hapticlink as hl
from hapticlink.analysis.stability.hands import spring
from hapticlink.analysis.stability.port_response import hand_port, response
from hapticlink.analysis.stability.resting_scene import resting
from hapticlink.analysis.transparency import mobility_at_hand as transparency
from hapticlink.analysis.transparency.mobility_at_hand import FORCE, HERTZ
from hapticlink.analysis.tune.stability_limits import Judge
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.specs.control import Teleoperation, Topology
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.overrides import write_options
from tests.mechanisms import standing_rod

T = 1 / 512
LENGTH = 0.2
W = 2 * np.pi * HERTZ
ENCODERS = {"sensing": "encoders", "device.encoder.resolution": 1e-9}


def mobility() -> NDArray[np.float64]:
    """Free along x with 2 kg and turning with .01 kg.m2, held along y."""
    return np.diag([0.5, 0.0, 100.0])


def test_a_delay_is_felt_as_an_error_of_its_phase() -> None:
    """X = Lambda^-1 exp(-i w d)/-w^2: |exp(i w d) - 1| = 2 sin(w d/2), in each direction."""
    delay = 2e-3
    X = -np.exp(-1j * W * delay)[:, None, None] * mobility() / (W * W)[:, None, None]
    found = transparency.of("", "", X, mobility(), LENGTH)
    assert sorted(d.inertia for d in found.free) == pytest.approx([0.01 / LENGTH**2, 2.0])
    for direction in found.free:
        assert direction.error == pytest.approx(2 * np.sin(W * delay / 2), rel=1e-9)
        assert direction.right_up_to == pytest.approx(FORCE / (2 * np.pi * delay), rel=2e-3)
    (constraint,) = found.constrained
    assert np.isinf(constraint.slow)
    assert np.isinf(found.width)


def test_a_spring_and_a_mass_too_many_are_felt_as_what_they_are() -> None:
    """A constraint of 1 N/mm; 3 kg for 2 along x, so that nothing is right."""
    X = np.zeros((len(W), 3, 3), complex)
    X[:, 0, 0], X[:, 1, 1], X[:, 2, 2] = -1 / (3 * W**2), 1e-3, -100 / W**2
    found = transparency.of("", "", X, mobility(), LENGTH)
    heavy = max(found.free, key=lambda d: d.inertia)
    assert heavy.felt == pytest.approx(3.0 + 0j)
    assert heavy.error == pytest.approx(0.5)
    assert heavy.right_up_to == 0.0 == found.right_up_to
    assert found.constrained[0].slow == pytest.approx(1000.0)
    light = 0.01 / LENGTH**2
    slow = 2 * np.pi * transparency.SLOW
    assert found.width == pytest.approx(1000.0 / (slow**2 * light))


def test_ideal_sensing_is_right_up_to_half_a_period_of_delay() -> None:
    """The impedance law makes the mechanism's inertia exactly, and the held motors' force is T/2
    late: right up to .1/(2 pi T/2)."""
    found = transparency.transparency("closed-loop-ideal", count=1)[0]
    assert found.right_up_to == pytest.approx(FORCE / (np.pi * T), rel=0.02)


def shaken(scene: str, options: dict[str, Any], target: dict[str, Any], seconds: float) -> hl.Run:
    hand = {"stiffness": [1000.0, 1000.0, 3.0], "damping": [50.0, 50.0, 0.1]}
    given = options | {"hand": {"type": "spring", "target": target} | hand, "duration": seconds}
    return hl.run(scene, given, figures=False)


def phasor(t: NDArray[np.float64], y: NDArray[np.float64], hertz: float) -> NDArray[np.complex128]:
    """Of a sine with a slow drift, by least squares."""
    turn = 2 * np.pi * hertz * t
    base = np.stack([np.cos(turn), np.sin(turn), np.ones_like(t), t, t * t], axis=1)
    a, b, *_ = np.linalg.lstsq(base, y, rcond=None)[0]
    return np.asarray(a - 1j * b)


@pytest.mark.parametrize("options", [{}, ENCODERS])
def test_the_compliance_is_that_of_shaken_runs(options: dict[str, Any]) -> None:
    """At the start of closed-loop-ideal, in a firm grip that is shaken by .1 mm along x and y:
    poses and forces of the FMUs at the frequency, within .1 %. Of encoders
    with counts so fine that they are not seen."""
    start = hl.run("closed-loop-ideal", {"duration": 0.01}, figures=False)
    pose = start.tables["haptics"]["virtual_mechanism.x"][0].tolist()
    held = write_options(options | {"hand": spring(pose, (0.0, 0.0, 0.0), 1000.0)})
    with resting("closed-loop-ideal", held) as place:
        cut = response(place.period({}), hand_port(place.map.system))
    S = np.diag([1.0, 1.0, LENGTH])
    for hertz, axis in ((2.0, 0), (50.0, 1)):
        amplitude = [0.0, 0.0, 0.0]
        amplitude[axis] = 1e-4
        sine = {"mean": pose, "amplitude": amplitude, "frequency": [hertz] * 3}
        table = shaken("closed-loop-ideal", options, sine, 3.0).tables["haptics"]
        late = table["time"] > 2.0
        t = table["time"][late] - 2.0
        x, F = (phasor(t, table[n][late], hertz) for n in ("haptic_device.x", "hand.F"))
        off = S @ (x - cut.compliance(hertz, T) @ F)
        assert np.linalg.norm(off) < 1e-3 * np.linalg.norm(S @ x)


def test_a_pressed_run_gives_the_felt_stiffness() -> None:
    """A hand without a spring presses along the constrained direction at 2 Hz: within 1 %."""
    read = open_scene.load("closed-loop-ideal", write_options(ENCODERS))
    assert read.linkage
    S = np.diag([1.0, 1.0, mean_link_length(read.linkage)])
    felt = transparency.transparency("closed-loop-ideal", write_options(ENCODERS), count=1)[0]
    (constraint,) = felt.constrained
    hertz = float(HERTZ[np.argmin(np.abs(HERTZ - transparency.SLOW))])
    wrench = (0.05 * S @ constraint.along).tolist()
    sine = {"amplitude": wrench, "frequency": [hertz] * 3, "phase": [np.pi / 2] * 3}
    hand = {"type": "profile", "table": sine}
    given = ENCODERS | {"hand": hand, "linkage.start_velocity": {}, "duration": 3.0}
    table = hl.run("closed-loop-ideal", given, figures=False).tables["haptics"]
    late = table["time"] > 1.0
    x, F = (
        phasor(table["time"][late], table[n][late], hertz) for n in ("haptic_device.x", "hand.F")
    )
    along = constraint.along
    size = abs(along @ np.linalg.inv(S) @ F) / abs(along @ S @ x)
    assert size == pytest.approx(constraint.slow, rel=0.01)


def test_a_loop_that_is_unstable_says_so_before_its_numbers() -> None:
    """A rod that stands on its end falls when it is let go; a firm grip keeps it there. Without a
    hand that does, no number is told."""
    rod, growth = standing_rod()
    falls: dict[str, Any] = {"linkage": rod, "controller.bias": "full", "duration": 0.1}
    falls["graphics.rate"] = 29.97  # repeats after 100 s
    (found,) = transparency.transparency("single-body", write_options(falls), count=1)
    let_go = found.growing[0]
    assert let_go.free
    assert let_go.growth == pytest.approx(growth, rel=0.01)
    assert "firm grip" in found.steady_in
    assert "arm at rest, soft grip" not in found.steady_in
    _, first, *others = found.lines()
    assert first.startswith("  unstable when let go: a divergence of 0 Hz grows at 11.3 1/s")
    assert any("firm grip" in line for line in others)
    assert any("is felt as" in line for line in others)
    lines = list(replace(found, steady_in=()).lines())
    judged = "judged with graphics at 29.97073 Hz: with its own rates all repeats only after 100 s"
    assert lines[-2:] == ["  no hand that was tried feels it steadily", f"  {judged}"]
    assert not any("is felt as" in line for line in lines)
    (calm,) = transparency.transparency("single-body", count=1)
    assert (calm.growing, calm.rounded) == ((), "")
    assert not any("unstable" in line for line in calm.lines())


def test_what_is_felt_is_that_of_runs_in_the_hands_that_keep_it_steady() -> None:
    """With frames of 17 haptic periods a firm grip shakes closed-loop-direct, and a light touch
    does not: shaken by .1 mm at 2 Hz the latter has the compliance within 1 %."""
    options: dict[str, Any] = {"graphics.rate": "512/17"}
    found = transparency.transparency("closed-loop-direct", write_options(options), count=1)[0]
    assert [case.hand for case in found.growing] == ["firm grip"]
    assert "light touch" in found.steady_in
    start = hl.run("closed-loop-direct", options | {"duration": 0.01}, figures=False)
    mean = start["virtual_mechanism.x"][0].tolist()
    held = write_options(options | {"hand": spring(mean, (0.0, 0.0, 0.0), 1000.0)})
    with resting("closed-loop-direct", held) as place:
        X = response(place.period({}), hand_port(place.map.system)).compliance(2.0, T)
    sine = {"mean": mean, "amplitude": [1e-4, 0.0, 0.0], "frequency": [2.0] * 3}
    hand = {"type": "spring", "target": sine, "stiffness": [100.0, 100.0, 0.33]}
    given = options | {"hand": hand | {"damping": [5.0, 5.0, 0.01]}, "duration": 8.0}
    run = hl.run("closed-loop-direct", given | {"linkage.start_velocity": {}}, figures=False)
    table = run.tables["haptics"]
    late = table["time"] > 5.0
    t = table["time"][late] - 5.0
    x, F = (phasor(t, table[n][late], 2.0) for n in ("haptic_device.x", "hand.F"))
    S = np.diag([1.0, 1.0, LENGTH])
    assert np.linalg.norm(S @ (x - X @ F)) < 0.01 * np.linalg.norm(S @ x)


def test_costs_are_those_of_changed_scenes_and_their_limit_that_of_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the mechanism at 512 Hz no hold counts at rest. At 11 times the stiffnesses the handle
    comes to rest if the motors are a period late, and not if they are not, as the limits say."""
    monkeypatch.setattr(Judge, "margin", partialmethod(Judge.margin, fine=0.2))
    costs = {
        c.change: c for c in transparency.costs("closed-loop-ideal", write_options(ENCODERS), print)
    }
    own, half = costs["as it is"], costs["half the haptic rate"]
    assert costs["hold foh"].cells() == own.cells() == costs["half the graphics rate"].cells()
    late = costs["motors a haptic period late"]
    assert (half.times or 9.0) < 4.0 < (own.times or 0.0) < 11.0 < (late.times or 0.0)
    assert half.stiffest is not None
    assert own.stiffest is not None
    assert half.stiffest.width < own.stiffest.width
    lines = list(transparency.cost_lines(list(costs.values())))
    assert lines[1].startswith("as it is, half the graphics rate, twice the")
    other = replace(half, felt=replace(half.felt, rounded="judged elsewhere"))
    assert [*transparency.cost_lines([own, other])][-1] == "judged elsewhere: half the haptic rate"
    assert sum(" times" in line for line in lines) == 6
    pose = hl.run("closed-loop-ideal", {"duration": 0.01}, figures=False)["virtual_mechanism.x"][0]
    hand = spring((pose + np.array([1e-4, 0.0, 1e-3])).tolist(), (0.0, 0.0, 0.0), 100.0)
    given: dict[str, Any] = ENCODERS | {"hand": hand, "linkage.start_velocity": {}, "duration": 2.0}
    control = open_scene.load("closed-loop-ideal").controller
    assert control is not None
    assert isinstance(control.teleoperation, Teleoperation)
    for law, of in (("teleoperation", control.teleoperation), ("topology", Topology())):
        given[f"controller.{law}.stiffness"] = (11.0 * np.array(of.stiffness)).tolist()
        given[f"controller.{law}.damping"] = (11.0**0.5 * np.array(of.damping)).tolist()
    for delays, rests in (({}, False), ({"controller.F_motor": T}, True)):
        run = hl.run("closed-loop-ideal", given | {"delays": delays}, figures=False)
        assert (np.abs(run["haptic_device.v"][-200:]).max() < 1e-4) == rests


def test_a_run_that_fails_is_said(caplog: pytest.LogCaptureFixture) -> None:
    """A coupling of 1 MN/m throws the body off within .1 s; as shipped nothing is said."""
    stiff = "controller.teleoperation.stiffness=[1e6, 1e6, 1e3]"
    for options, said in (((stiff,), 1), ((), 0)):
        caplog.clear()
        assert transparency.transparency("single-body", options, count=1)
        assert caplog.text.count("the scene's own run fails: virtual_mechanism: output ") == said
