"""Chapters 6 and 7: the experiment with Table 6.1, and the conclusions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator.results.read_results import Results
from studies.report import appendix_a
from studies.report.chapter6 import describe_end
from studies.report.five_bar import shipped
from studies.report.report_page import Runs, command
from studies.report.statements.statement import Statement, compare, leave, misprinted
from studies.report.systems import IDEAL_6, OF_CHAPTER_6, OFF, ON, STATED_6, VARYING_6, System

INFO = "hapticlink info closed-loop"
SETTINGS_6 = command("closed-loop", "duration=0.1")
TOPOLOGY = "controller.F_constraint"


def statements(runs: Runs) -> Iterator[Statement]:
    yield from _experiment(runs)
    yield from _results(runs)
    yield from _conclusion(runs)


def _experiment(runs: Runs) -> Iterator[Statement]:
    on, linkage = STATED_6.run(runs, ON), shipped()
    again = runs(STATED_6.scene, "mechanism.directions=true", ON, 'title="Once more"').haptics
    same = np.abs(again["haptic_device.x_true"] - on.haptics["haptic_device.x_true"]).max()
    yield compare(
        "6",
        "a force from a block instead of a hand makes the experiment repeatable",
        same == 0,
        f"two runs differ by {same:g}",
        STATED_6.command(ON),
    )
    at = (linkage.held.at or (0.0, 0.0))[0]
    yield compare(
        "6",
        "the user holds the centre of mass of the second link",
        linkage.held.body == "link2" and at == appendix_a.L[1] / 2,
        f"link2 at {1e3 * at:g} mm",
        SETTINGS_6,
    )
    lengths = (
        *(j.at_parent[0] for j in linkage.joint if j.at_parent),
        *(p[0] for p in linkage.loop[0].at),
    )
    found = (
        sorted(lengths),
        sorted(b.mass for b in linkage.body),
        sorted(b.moments[0] for b in linkage.body),
    )
    stated = sorted(appendix_a.L), sorted(appendix_a.M), sorted(appendix_a.J)
    yield compare(
        "table 6.1",
        "lengths, masses and inertias of the links",
        all(np.allclose(a, b) for a, b in zip(found, stated, strict=True)),
        "scene `five-bar` has them",
        command("five-bar", "duration=0.1"),
    )
    gap = float(np.linalg.norm(appendix_a.h(np.array(appendix_a.Q0))))
    start = on.haptics["virtual_mechanism.q"][0]
    yield compare(
        "6",
        "the linkage starts at rest at q0 = (pi/4, -pi/2, -4 pi/10, pi/2)",
        np.abs(start - appendix_a.Q0).max() < 2.5e-3,
        f"Table 6.1 leaves the loop open by "
        f"{1e3 * gap:.2g} mm there; assembly moves the angles by at most "
        f"{np.abs(start - appendix_a.Q0).max():.1e} rad",
        "pytest tests/test_errata.py::"
        "test_rounded_lengths_of_table_6_1_miss_closure_by_a_tenth_of_a_millimetre",
    )
    yield push("6", "F_h = (-0.5 N, 0, -0.0025 N.m) throughout", on, SETTINGS_6)
    yield both_ways(
        "6", "two experiments, with and without the topology controller", STATED_6, runs
    )
    yield misprinted(
        "6",
        "trajectories are plotted in 6.3(a) and 6.3(b)",
        "they are those of 6.1(a) and 6.1(b), by the captions",
        "hapticlink reproduce",
    )


def push(place: str, text: str, results: Results, shown: str) -> Statement:
    """The statement that the hand's wrench is the report's, in a run."""
    F = results.haptics["hand.F"]
    found = f"{F[0, 0]} N, {F[0, 1]:g} N, {F[0, 2]} N.m"
    return compare(place, text, np.all(F == appendix_a.WRENCH), found, shown)


def both_ways(place: str, text: str, system: System, runs: Runs) -> Statement:
    """The statement that there are two experiments."""
    there = [TOPOLOGY in system.run(runs, way).haptics for way in (ON, OFF)]
    found = "controller.topology = true and false: the controller puts F_T out, and does not"
    return compare(
        place, text, there == [True, False], found, f"{system.command(ON)}; {system.command(OFF)}"
    )


def _results(runs: Runs) -> Iterator[Statement]:
    gaps = {s: {w: tracking(s.run(runs, w))[1].max() for w in (ON, OFF)} for s in OF_CHAPTER_6}
    said = "; ".join(
        f"{s.name}: {g[ON]:.2g} mm with, {g[OFF]:.0f} mm without it" for s, g in gaps.items()
    )
    commands = "; ".join(s.command(w) for s in OF_CHAPTER_6 for w in (ON, OFF))
    yield compare(
        "figure 6.1",
        "with the topology controller the device follows the simulated hand",
        all(g[ON] < g[OFF] / 10 for g in gaps.values()),
        said,
        commands,
    )
    for i, place in ((0, "figure 6.2"), (1, "figure 6.3")):
        worst = {}
        for way in (ON, OFF):
            haptics = STATED_6.run(runs, way).haptics
            apart = haptics["virtual_mechanism.x"][:, i] - haptics["haptic_device.x_true"][:, i]
            worst[way] = 1e3 * float(np.abs(apart).max())
        yield compare(
            place,
            f"the error in {'xy'[i]} is smaller with the topology controller",
            worst[ON] < worst[OFF],
            f"{worst[ON]:.2g} mm with, {worst[OFF]:.3g} mm without",
            f"{STATED_6.command(ON)}; {STATED_6.command(OFF)}",
        )
    off = STATED_6.run(runs, OFF)
    yield compare(
        "6",
        "without the topology controller the experiment is stopped before the device reaches its "
        "workspace limit",
        off.record.end.reason == "stop_when",
        f"as stated: {describe_end(off)}; "
        f"10 to 50 Hz: {describe_end(VARYING_6.run(runs, OFF))}; idealised: "
        f"{describe_end(IDEAL_6.run(runs, OFF))}",
        "; ".join(s.command(OFF) for s in OF_CHAPTER_6),
    )


def _conclusion(runs: Runs) -> Iterator[Statement]:
    on, off = (tracking(STATED_6.run(runs, way))[1].max() for way in (ON, OFF))
    gap = STATED_6.run(runs, ON).haptics["virtual_mechanism.closure_error"].max()
    yield compare(
        "7",
        "loops closed by multipliers with Baumgarte's terms in configuration space",
        gap < 1e-4,
        f"closed to {1e6 * gap:.2g} um in the run",
        STATED_6.command(ON),
    )
    controller = STATED_6.run(runs, ON).record.scene["controller"]
    parts = [part for part in ("impedance", "topology", "teleoperation") if controller[part]]
    yield compare(
        "7; B.7",
        "impedance control renders the inertia, a stiffness the joint constraints",
        {"impedance", "topology"} <= {*parts},
        f"the parts of the controller: {', '.join(parts)}; see 4.2",
        INFO,
    )
    yield compare(
        "7",
        "the hand can be held to what closed loops allow",
        on < off / 10,
        f"{on:.2g} mm apart against {off:.0f} mm",
        f"{STATED_6.command(ON)}; {STATED_6.command(OFF)}",
    )
    yield leave(
        "7",
        "several users on one linkage are future work",
        "done here: scene `two-users`",
        "hapticlink info two-users",
    )
    yield leave(
        "7",
        "choosing the stiffness so that contacts and joints feel equally stiff is future work",
        "done here: `hapticlink tune`",
        "hapticlink tune closed-loop",
    )
