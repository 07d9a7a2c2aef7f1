"""Scenes in which the premise of a sentence is broken, and by which the sentence changes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import pytest

import hapticlink as hl
from hapticlink.analysis.findings.report_premises import describe_experiment
from hapticlink.analysis.findings.summary import _lacking, _percent, describe_work
from hapticlink.analysis.stability.frozen_nonlinearities import describe_switches
from hapticlink.analysis.stability.hand_cases import NOWHERE, Case
from hapticlink.analysis.stability.hands import FREE
from hapticlink.analysis.stability.margin_and_remedy import Margin
from hapticlink.analysis.stability.modes import Bounds
from hapticlink.analysis.stability.poses import Pose
from hapticlink.analysis.stability.remedy_trial import Remedy
from hapticlink.analysis.stability.smooth_scene import linearisable
from hapticlink.analysis.stability.verdict_record import Stability
from hapticlink.analysis.tune.tuning_result import Tuned
from hapticlink.orchestrator.results.numbers import short
from hapticlink.visualization.compare import page
from hapticlink.visualization.figures import run_figures

HANDS = ("light touch", "firm grip", "stiff arm")


def verdict(*cases: tuple[str, str, float, str, str]) -> Stability:
    """Of hands in poses: (pose, hand, growth, verdict, kind)."""
    of = tuple(
        Case(pose, hand, growth, 1e-3, 0.4, kind, said, ())
        for pose, hand, growth, said, kind in cases
    )
    return Stability(
        "", Bounds(), (), dict.fromkeys([case.hand for case in of]), of, {},
        max(of, key=lambda c: (c.rank, c.growth)), Margin(2.0, None, None), (), (),
    )  # fmt: skip


def test_a_verdict_of_drift_names_the_hands_that_drift() -> None:
    """A hand whose divergence leads nowhere is marginal, whatever its growth rate."""
    drifts = ("0 s", "light touch", 0.08, "unstable", "drift")
    marginal = ("0 s", "firm grip", 0.26, "marginal", "divergence")
    found = verdict(drifts, marginal, ("0 s", "stiff arm", -0.5, "stable", "oscillation"))
    assert found.verdict == "drifts"
    assert found.finding == (
        "drifts slowly in 1 of 3 hands, and marginal in 1, 1 pose: drift of 0.4 Hz "
        "grows at 0.08 1/s in light touch at 0 s"
    )
    assert found.record()["worst"]["hand"] == "light touch"
    shakes = verdict(drifts, marginal, ("0 s", "stiff arm", 0.5, "unstable", "oscillation"))
    assert shakes.finding.startswith("unstable: oscillation of 0.4 Hz grows at 0.5 1/s")
    calm = verdict(("0 s", "light touch", -0.1, "stable", "drift"), marginal)
    assert calm.finding.startswith("stable in 1 of 2 hands and marginal in the others, 1 pose")


def test_a_free_handle_in_which_nothing_grows_may_come_to_rest() -> None:
    """Under a constant wrench, where its linkage is stretched."""

    def said(growth: float, word: str) -> str:
        held = ("0 s", "light touch", -1.0, "stable", "oscillation")
        return verdict(held, ("0 s", FREE, growth, word, "drift")).finding

    assert said(-0.5, "stable").startswith("not held: in free air small motions do not grow; ")
    assert "small motions neither grow nor decay; " in said(0.0, "marginal")
    assert "in free air it drifts at 0.1 1/s" in said(0.1, "unstable")


def test_a_verdict_says_for_what_it_is_and_what_it_left_out() -> None:
    """The friction of the hold passive is taken out, and a switch stays as it is: a run of
    0.3 mm beside a pose in which small motions decay can go on for ever."""
    held = verdict(("0 s", "light touch", -1.0, "stable", "oscillation"))
    assert not any(line.startswith("judged for") for line in held.lines())

    def said(**options: Any) -> str:
        with linearisable("closed-loop-direct", options) as (_, system, removed):
            frozen = (*removed, *describe_switches(system))
        (line,) = (x for x in replace(held, frozen=frozen).lines() if x.startswith("judged for"))
        return line

    assert said(hold="passive", sensing="encoders") == (
        "judged for small motions; taken out: quantisation of the encoders, the friction of hold "
        "passive; as at the equilibrium: saturation of the motors, and the stops, number of "
        "constrained directions"
    )
    early = {"hold": "model", "downsampling": "model", "directions_from": "mechanism"}
    assert said(sensing="ideal", **early).endswith(
        "number of constrained directions; as half-lead, its law for motions far below 10 um in a "
        "step: larger ones may decay: hold reaction"
    )


def test_a_margin_says_that_other_poses_may_have_less() -> None:
    one = [("0 s", hand, -1.0, "stable", "oscillation") for hand in HANDS]
    (line,) = (line for line in verdict(*one).lines() if line.startswith("margin"))
    assert line == "margin at 0 s (drifts aside): stiffnesses times 2"
    several = verdict(*one, ("1 s", "firm grip", -2.0, "stable", "oscillation"))
    (line,) = (line for line in several.lines() if line.startswith("margin"))
    assert line.startswith("margin at 0 s (drifts aside; other poses may have less): ")


def test_a_margin_names_hands_that_it_leaves_out() -> None:
    """Those whose divergence leads nowhere, which the table does not call marginal alone."""
    near = ("0 s", "arm at rest, soft grip", 2.0, "marginal", NOWHERE)
    found = verdict(("0 s", "firm grip", 0.3, "unstable", "oscillation"), near)
    remedy = Remedy(("hold=zoh",), -0.5, True)
    margin = Margin(2.0, None, None, left_out=(near[1],))
    lines = [*replace(found, margin=margin, remedies=(remedy,)).lines()]
    assert "margin at 0 s (drifts aside, and hands with a divergence within 5 mm): " in str(lines)
    assert any(x.startswith("arm at rest") and x.endswith(f"  {NOWHERE}") for x in lines)
    assert any(x.endswith("decays at 0.5 1/s in the other hands") for x in lines)
    assert "drifts aside): " in str([*found.lines()])


def test_a_remedy_says_in_how_many_hands_it_drifts() -> None:
    found = verdict(("0 s", "firm grip", 0.3, "unstable", "oscillation"))

    def said(*drifting: str) -> str:
        remedy = Remedy(("hold=zoh",), -0.5, True, drifting=drifting)
        return next(x for x in replace(found, remedies=(remedy,)).lines() if "remedy" in x)

    assert said().endswith("decays at 0.5 1/s")
    assert said("light touch", "stiff arm").endswith("1/s; drifts in 2 of the hands")


@pytest.mark.parametrize(("aside", "told"), [(0.004, False), (0.05, True)])
def test_an_equilibrium_far_from_the_run_is_told(aside: float, told: bool) -> None:
    """The handle counts, too, but no angle."""
    pose = Pose(0.0, {}, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
    found = verdict(("0 s", "firm grip", -1.0, "stable", "oscillation"))
    (case,) = found.cases
    at = replace(pose, point=(0.1, 0.0, 0.5), handle=(0.1, aside, 0.0))
    lines = replace(found, poses=(pose,), cases=(replace(case, at=at),)).lines()
    far = "at 0 s the equilibrium that is judged is up to 50 mm from where the run was"
    assert (far in lines) == told


SPRING: dict[str, Any] = {
    "type": "spring",
    "stiffness": [300.0, 300.0, 1.0],
    "damping": [5.0, 5.0, 0.01],
}
START = (0.04452, 0.0148, -0.7878)


def holding(x: float, y: float, theta: float) -> dict[str, Any]:
    return {"hand": {**SPRING, "target": [[0.0, x, y, theta]]}}


@pytest.mark.parametrize(
    ("scene", "broken", "remedied", "said"),
    [
        ("closed-loop-ideal", holding(0.08, *START[1:]), holding(*START), "begins with a pull of"),
        (
            "obstacles",
            {"contacts.stiffness": 1e8},
            {"contacts.stiffness": 1e8, "mechanism.integrator": "linearly-implicit"},
            "too fast for steps of",
        ),
        (
            "five-bar",
            {"linkage.start.elbow1": -1.0},
            {"linkage.start.elbow1": -1.5707963},
            "the loops do not close at the given start",
        ),
        (
            "enclosure",
            {"mechanism.integrator": "passive-midpoint"},
            {"mechanism.integrator": "passive-midpoint", "contacts.detection": "haptics"},
            "passive-midpoint makes no energy within a step, but",
        ),
    ],
)  # fmt: skip
def test_a_warning_ends_with_what_it_advises(
    scene: str, broken: dict[str, Any], remedied: dict[str, Any], said: str
) -> None:
    def warnings(options: dict[str, Any]) -> str:
        return "\n".join(
            hl.run(scene, {"duration": 0.02, **options}, figures=False).run["warnings"]
        )

    assert said in warnings(broken)
    assert said not in warnings(remedied)


def test_the_stops_of_a_further_user_act_only_outside_of_its_workspace() -> None:
    def told(x: float) -> str:
        path = [[0.0, 0.0247, -0.0113, 0.314], [0.3, x, -0.0113, 0.314]]
        pulled = {**SPRING, "stiffness": [2000.0, 2000.0, 1.0], "damping": [20.0, 20.0, 0.05]}
        options = {"duration": 0.4, "stop_when": "", "hands.left": {**pulled, "target": path}}
        return str(hl.run("two-users", options, figures=False))

    said = "the handle of left left its device's workspace, and its stops acted"
    assert said in told(0.3)
    assert said not in told(0.0247)


def test_of_thinned_rows_no_figure_or_sum_claims_more() -> None:
    """Its port generates up to 15 mJ within a few frames, of which one in fifty is kept."""
    scene, options = "closed-loop-direct", {"graphics.rate": 14, "duration": 1.5}
    whole = hl.run(scene, options, figures=False)
    thin = hl.run(scene, {**options, "record.every": 50}, figures=False)
    assert whole.record.user_port
    assert thin.record.user_port
    assert thin.record.user_port.peak < 0.5 * whole.record.user_port.peak
    assert "energy at the user's port: " in str(whole)
    assert "energy at the user's port, in one row of 50: " in str(thin)
    assert "reported and drawn from one row in 50 (record.every)" in str(thin)
    for run, said in ((whole, False), (thin, True)):
        for name in ("distance", "user_port"):
            figure = run_figures.figures(run)[name]
            title = " ".join(figure.axes[0].get_title().split())
            assert title.endswith(", in one row of 50") is said


def test_a_hand_that_is_led_takes_energy_out() -> None:
    """The linkage falls, and the hand brakes it."""
    falls = {"linkage.gravity": [0.0, -9.81], "controller.bias": "full", "duration": 0.3}
    led = hl.run("closed-loop-ideal", {**falls, **holding(*START)}, figures=False)
    assert "energy at the user's port: the hand took out " in str(led)
    pushed = hl.run("closed-loop-ideal", {"duration": 0.3}, figures=False)
    assert "energy at the user's port: the hand put in " in str(pushed)
    assert (describe_work(-2.0, "taken"), describe_work(2.0)) == ("taken out 2 mJ", "put in 2 mJ")


def test_what_two_hands_put_in_is_not_said_of_one() -> None:
    run = hl.run("two-users", {"duration": 0.2}, figures=False)
    assert run.record.user_port
    own, other = (run.record.user_port.works[name] for name in ("hand", "left: hand"))
    assert own != 0.0 != other
    (line,) = (line for line in str(run).split("\n") if "energy at the user's port" in line)
    assert f": the hands together put in {short(1e3 * (own + other))} mJ" in line
    legend = run_figures.figures(run)["user_port"].legends[0].get_texts()
    assert "put in by the hands together" in [" ".join(t.get_text().split()) for t in legend]


def test_runs_that_a_clock_drives_are_not_said_to_repeat() -> None:
    run = hl.run("sampled-spring", {"duration": 0.1}, figures=False)

    def said(**record: Any) -> bool:
        other = Mock(wraps=run, record=replace(run.record, **record))
        other.run = run.run
        return "gives the same tables" in next(page._again({"a": other}))

    assert said()
    assert said(real_time={"arrivals": "runs/a"})
    assert not said(real_time={"ticks": 51})
    assert not said(network={"virtual_environment": {}})


def test_a_tuning_that_fails_or_is_lowered_says_so() -> None:
    own = {"distance": 1e-3, "energy_peak": 2e-4}

    def line(motion: dict[str, float]) -> str:
        tuned = Tuned(Mock(), 2.0, [], "0 s", {}, {"tuned": 2.0}, {"scene": {"contact": 1.0}, "tuned": {"contact": 2.0}}, {"tuned": motion})  # fmt: skip  # noqa: E501
        return next(line for line in tuned.lines() if "along the run" in line)

    assert line(own).endswith(
        "handle at most 1 mm off, at most 0.2 mJ generated at the user's port"
    )
    failed = line({"distance": math.inf, "energy_peak": math.nan})
    assert failed.endswith("along the run, it fails, or generates more energy than is put in")


def test_what_differs_from_the_report_is_named_and_nothing_else() -> None:
    def said(scene: str, options: dict[str, Any]) -> str:
        return " ".join(
            describe_experiment(
                hl.run(scene, {"duration": 0.01, **options}, figures=False).run["scene"]
            )
        )

    assert "no encoders and no observer" not in said("closed-loop", {})
    assert "no encoders and no observer" in said("closed-loop", {"sensing": "ideal"})
    assert "pulled at every joint" in said("closed-loop", {"graphics.sync": "joint"})
    assert said("closed-loop-direct", {}) == ""


@pytest.mark.parametrize(("limit", "there"), [(0.02, True), (5.0, False)])
def test_a_hand_feels_less_only_where_motors_reach_their_limit(limit: float, there: bool) -> None:
    options = {"device.motor.torque_limit": limit, "duration": 0.5, "stop_when": ""}
    run = hl.run("closed-loop-ideal", options, figures=False)
    assert ("the hand felt less than the controller asked for" in str(run)) == there


def test_the_workspace_is_not_seen_only_without_its_margin() -> None:
    run = hl.run("closed-loop-ideal", {"duration": 0.02}, figures=False)
    swapped = replace(run.record, replaced={"haptic_device": Mock()})
    told = "haptic_device has no workspace_margin: that the handle leaves its workspace is not seen"

    def said(names: Sequence[str]) -> bool:
        kept = run.tables["haptics"]
        rows = kept.rows[:, [kept.columns.index(name) for name in names]]
        tables = {**run.tables, "haptics": replace(kept, columns=tuple(names), rows=rows)}
        return told in _lacking(Mock(record=swapped, tables=tables))

    columns = run.tables["haptics"].columns
    assert not said(columns)
    assert said([name for name in columns if name != "haptic_device.workspace_margin"])


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.0234, "about 2.3 %"), (8.4, "about 840 %"), (12.0, "more than 1000 %")],
)
def test_a_change_by_a_step_is_a_number_up_to_a_bound(share: float, said: str) -> None:
    assert _percent("about", share) == said
