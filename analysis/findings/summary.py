"""The summary of a run in the terminal: how it ended, and warnings."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import groupby, islice
from typing import Any

import numpy as np

from hapticlink.analysis.findings import friction_speed
from hapticlink.analysis.findings.deadlines import finding
from hapticlink.analysis.findings.forces import WRENCHES, all_wrenches
from hapticlink.analysis.findings.tracking import (
    folded,
    further_users,
    has_tracking,
    of_block,
    pose_error,
)
from hapticlink.analysis.findings.user_port import pushed_by_others
from hapticlink.components.specs.linkage import COORDINATE_UNITS
from hapticlink.orchestrator.base.loop_names import (
    CLOSURE_ERROR,
    CONSTRAINT_COUNTS,
    CONTACT_GAP,
    COPY_BRANCH_OK,
    HAND,
    HAND_WRENCH,
    HANDLE_POSE,
    JOINT_COORDINATES,
    JOINT_RATES,
    MECHANISM,
    MECHANISM_ENERGY,
    MECHANISM_STOPS,
    MOTOR_WRENCH,
    POINT_POSE,
    WORKSPACE_MARGIN,
    signal_of_user,
    user_of_block,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.scene.start_pose import outside


def ending(results: Results) -> str:
    """How and when a run ended: `done at 3 s`."""
    run, end = results.run, results.run["end"]
    if "time" not in end:
        return "not ended: it is still running, or its process was killed"
    how = {
        "stop_when": f"ended by {run['stop_when']}",
        "terminated": f"ended: {end.get('asked')},",
        "duration": "done",
    }
    return f"{how.get(end['reason'], end['reason'])} at {end['time']:.6g} s"


def numbers(results: Results) -> Iterator[str]:
    """What one would open the figures for: tracking error, largest forces, closure of the loops."""
    if has_tracking(results) and len((error := pose_error(results)).time_s):
        distance = error.distance_mm
        rms = float(np.sqrt(np.mean(distance**2)))
        yield (
            f"handle at most {short(distance.max())} mm from the operational point, "
            f"{short(rms)} mm RMS; turned from it by at most {short(error.angle_rad.max())} rad"
        )
    for user in further_users(results):
        further = pose_error(results, user)
        if not len(further.time_s):
            continue
        yield (
            f"handle of {user} at most {short(further.distance_mm.max())} mm from its point; "
            f"turned from it by at most {short(further.angle_rad.max())} rad"
        )
        margin = signal_of_user(WORKSPACE_MARGIN, user)
        table = of_block(results, margin)
        if table and table[margin].min() < 0:
            yield f"warning: the handle of {user} left its device's workspace, and its stops acted"
    if found := all_wrenches(results):
        peaks = (f"{name} {short(force.max())} N" for name, (_, force, _) in found.items())
        yield f"largest forces: {'; '.join(peaks)}"
        yield from _saturated(results)
    if told := results.run.get("user_port"):
        yield (
            f"energy at the user's port beyond what the hand put in: at most "
            f"{short(1e3 * told['peak'])} mJ at {told['time_of_peak']:.3g} s, "
            f"{short(1e3 * told['generated'])} mJ at the end"
        )
    across = results.run.get("energies", "none")
    for name, energy in across.items() if across != "none" else ():
        if max(energy["peak"], abs(energy["generated"])) < NOTHING:
            continue
        yield (
            f"held {name} generated at most {short(1e3 * energy['peak'])} mJ at a time, "
            f"{short(1e3 * energy['generated'])} mJ in the end"
        )
    table = of_block(results, CLOSURE_ERROR)
    if table and len(table["time"]):
        yield f"loops close within {table[CLOSURE_ERROR].max():.2g} m"


def _saturated(results: Results) -> Iterator[str]:
    """A line for each user whose motors were at their torque limit, and for how long."""
    from hapticlink.analysis.findings.episodes import saturations

    for said, spans in groupby(saturations(results), key=lambda episode: episode.said):
        seconds = sum(span.end - span.begin for span in spans)
        yield f"{said} for {short(seconds)} s: the hand felt less than the controller asked for"


def lines(results: Results) -> Iterator[str]:
    """One line for each warning, which begins so, and for each note: start poses, folded copy, held
    outputs, repeated steps, contacts, convergence, lost samples, stability, and holds that did not
    fit."""
    run = results.run
    yield from _start(results)
    off, frames = folded(results)
    if off:
        yield (
            f"warning: the graphics copy was folded in {off} of {frames} frames, and with it "
            "Lambda_inv, P_c and contacts: take graphics.sync = 'exact'"
        )
    yield from replaced(run.get("replaced", {}))
    yield from unrecorded(run.get("not_recorded", ()), run["fmus"])
    if (every := run["scene"]["record"]["every"]) > 1:
        yield (
            f"told and drawn from one row in {every} (record.every): what happens between them, "
            "such as larger forces and energies, is not seen"
        )
    for name in pushed_by_others(results):
        yield f"no energy at the user's port: {name} is not the force of the handle's own hand"
    for fmu, count in run["held_outputs"].items():
        yield f'{fmu}: {count} outputs were not finite and held (faults.nan = "hold")'
    for fmu, count in run["smaller_steps"].items():
        yield f"{fmu}: {count} steps were discarded and repeated with smaller ones"
    if found := run.get("real_time"):
        yield from _real_time(found)
    if (found := run["iterations"]) and found["unconverged"]:
        yield f"warning: {found['unconverged']} of {found['steps']} iterated steps did not converge"
    for fmu, errors in run.get("step_errors", {}).items():
        yield from long_steps(fmu, errors, run["fmus"][fmu].get("block"))
    yield from friction_speed.coarse(results)
    yield from _passivity(results)
    yield from _stopped(results)
    yield from _contacts(results)
    for clock, steps in run["controlled_steps"].items():
        if steps["forced"]:
            few = f"{steps['forced']} of {steps['taken']} steps were accepted at the smallest size"
            yield f"warning: {clock}: {few} although their error was too large"
    for name, link in run["links"].items():
        if link["lost"] or link["overtaken"]:
            lost = f"{link['lost']} of {link['sent']} samples were lost"
            yield f"{name}: {lost}, {link['overtaken']} overtaken"
    if why := run.get("unstable"):
        yield f"warning: {why}: the loop is not passive"
    refused = sorted(run["holds_that_did_not_fit"].items(), key=lambda item: item[1]["hold"])
    for hold, group in groupby(refused, key=lambda item: item[1]["hold"]):
        found = list(group)
        kept = ", ".join(name.partition(" -> ")[2] for name, _ in found)
        reasons = dict.fromkeys(why["reason"].partition(":")[0] for _, why in found)
        yield f"zoh instead of the default hold {hold} for {kept}: {'; '.join(reasons)}"


def _passivity(results: Results) -> Iterator[str]:
    # casadi, for the torques of motors, which most of the terminal's lines can do without
    from hapticlink.analysis.findings import passivity_warnings

    yield from passivity_warnings.lines(results)


def _stopped(results: Results) -> Iterator[str]:
    """A line if the passive midpoint method had to stop the mechanism, and one if contacts change
    its energy between steps."""
    table = of_block(results, MECHANISM_STOPS)
    if table and (results.run["scene"]["contacts"] or {}).get("detection") == "graphics":
        yield (
            "passive-midpoint makes no energy within a step, but each new frame of contacts may "
            "change it: take contacts.detection = 'haptics'"
        )
    if table and len(table["time"]) and (stops := int(table[MECHANISM_STOPS][-1])):
        yield (
            f"warning: virtual_mechanism was stopped in {stops} steps, which its energy did not "
            "allow: take more mechanism.substeps or a higher rate"
        )


def _contacts(results: Results) -> Iterator[str]:
    if results.run["scene"]["contacts"]:
        from hapticlink.analysis.findings import contact_warnings

        yield from contact_warnings.lines(results)


def _real_time(found: Mapping[str, Any]) -> Iterator[str]:
    yield finding(found)
    if moved := found["moved"]:
        said = f"warning: the schedule was moved by {short(moved)} s in all"
        yield f"{said}: the machine was too slow, or suspended"
    for clock, samples in found["samples"].items():
        if samples["late"]:
            late = f"{samples['late']} of {samples['taken']} samples were late"
            yield f"{clock}: {late}, at most by {short(1e3 * samples['largest_lateness'])} ms"
    for fmu, why in found["in_loop"].items():
        yield f"{fmu} ran in the haptic loop: {why}"


NOTHING = 1e-9
"""Energy (J) that is not worth a line."""

USED = {
    "tracking": (POINT_POSE, HANDLE_POSE),
    "drawing of the mechanism": (JOINT_COORDINATES,),
    "forces": (*WRENCHES, MOTOR_WRENCH),
    "constrained directions": CONSTRAINT_COUNTS,
    "closure": (CLOSURE_ERROR,),
    "folded frames": (COPY_BRANCH_OK,),
    "depth of contacts": (CONTACT_GAP,),
    "friction": (JOINT_RATES,),
    "energy at the user's port": (HAND_WRENCH, HANDLE_POSE, MECHANISM_ENERGY),
}
"""The signals of what a run tells and draws."""


def unrecorded(left_out: Collection[str], fmus: Iterable[str] = ()) -> Iterator[str]:
    """A line if what a run of these FMUs tells and draws misses signals that are not recorded."""
    users = ["", *(user for name in fmus if (user := user_of_block(name, HAND)))]
    missing = {
        what: [
            s for user in users for name in names if (s := signal_of_user(name, user)) in left_out
        ]
        for what, names in USED.items()
    }
    said = [f"{what} ({', '.join(signals)})" for what, signals in missing.items() if signals]
    if said:
        yield f"not recorded, and so not told or drawn in full: {'; '.join(said)} (record.signals)"


LARGEST, SUM = 0.1, 0.1
"""Bounds of the relative error of a step, which may be an impact, and of the sum over all steps of
the mechanism (`step_check`); the controller takes back what would add up in the device."""


def long_steps(fmu: str, errors: Mapping[str, Any], block: str | None) -> Iterator[str]:
    """A line if the steps of an FMU were too long for its equations."""
    if errors["largest"] <= LARGEST and (errors["sum"] <= SUM or block != MECHANISM):
        return
    yield (
        f"warning: steps of {fmu} are too long: with half of them {errors['output']} changes by up "
        f"to {100 * errors['largest']:.2g} % of its largest value in one (at {errors['time']:.4g} "
        f"s), and by about {100 * errors['sum']:.2g} % in all: take more mechanism.substeps or a "
        "higher rate"
    )


def replaced(found: Mapping[str, Any]) -> Iterator[str]:
    """A line for each kind of thing that an FMU in the place of a block lacks."""
    for name, replacement in found.items():
        if lost := replacement["lost"]:
            yield f"{name} has no ports for {len(lost)} connections: {', '.join(lost)}"
        if unfed := replacement["unfed"]:
            yield f"{name}: inputs that nothing feeds: {', '.join(unfed)}"


def _start(results: Results) -> Iterator[str]:
    device = of_block(results, WORKSPACE_MARGIN)
    if (
        device
        and of_block(results, HANDLE_POSE, 3)
        and len(device["time"])
        and device[WORKSPACE_MARGIN][0] < 0
    ):
        yield f"warning: {outside(device[HANDLE_POSE][0], device[WORKSPACE_MARGIN][0])}"
    linkage = results.run["scene"]["linkage"]
    if not linkage:
        return
    size = sum(len(COORDINATE_UNITS[joint["type"]]) for joint in linkage["joint"])
    table = of_block(results, JOINT_COORDINATES, size)
    if table and len(table["time"]):
        yield from moved(linkage, table[JOINT_COORDINATES][0])


def moved(linkage: Mapping[str, Any], q: Sequence[float]) -> Iterator[str]:
    """A line if assembly moved joints far from their start in [linkage]; q are the assembled joint
    coordinates."""
    if far := list(_far(linkage, q)):
        yield f"warning: the loops do not close at the given start; assembly moved {', '.join(far)}"


def _far(linkage: Mapping[str, Any], q: Sequence[float]) -> Iterator[str]:
    rest = iter(q)
    for joint in linkage["joint"]:
        units = COORDINATE_UNITS[joint["type"]]
        found = list(islice(rest, len(units)))
        if joint["name"] not in linkage["start"]:
            continue
        given = np.atleast_1d(linkage["start"][joint["name"]]).tolist()
        for start, value, unit in zip(given, found, units, strict=True):
            if abs(value - start) > REPORTED[unit]:
                yield f"{joint['name']} from {start:.6g} to {value:.6g} {unit}"


REPORTED = {"rad": 0.1, "m": 0.01}
"""Moves of a joint by more than this are reported."""
