"""The summary of a run in the terminal: how it ended, and warnings."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby, islice
from typing import Any, NamedTuple

import numpy as np

from hapticlink.analysis.findings import friction_speed, model_premises
from hapticlink.analysis.findings.changes_of_point import describe_changes
from hapticlink.analysis.findings.forces import WRENCHES
from hapticlink.analysis.findings.measures import Measures, TrackingError
from hapticlink.analysis.findings.noticed import describe_noticed
from hapticlink.analysis.findings.rendered import describe_devices
from hapticlink.analysis.findings.report_premises import describe_experiment
from hapticlink.analysis.findings.tracking import (
    UserSignals,
    compares_angles,
    find_handle,
    of_any_shape,
    of_block,
    of_port,
    space_of,
)
from hapticlink.analysis.findings.user_port import allowance, find_other_pushes, tolerated_energy
from hapticlink.components.specs.joint_types import JOINT_TYPES
from hapticlink.orchestrator.base.plain_data import plain
from hapticlink.orchestrator.base.signal_names import (
    APPLIED_TORQUES,
    CLOSURE_ERROR,
    CONSTRAINT_COUNTS,
    CONTACT_GAP,
    COPY_BRANCH_OK,
    DEVICE,
    HAND,
    HAND_WRENCH,
    HANDLE_POSE,
    JOINT_COORDINATES,
    JOINT_RATES,
    MECHANISM,
    MECHANISM_ENERGY,
    MECHANISM_STOPS,
    MOTOR_TORQUES,
    MOTOR_WRENCH,
    POINT_POSE,
    WORKSPACE_MARGIN,
    signal_of_user,
    user_of_block,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import TABLES, Results
from hapticlink.orchestrator.results.run_record import PortEnergy, RunRecord, StepErrors
from hapticlink.orchestrator.scene.start_pose import describe_start_outside
from hapticlink.orchestrator.system.system import Replacement


class Findings(NamedTuple):
    """The record of a run with warnings, the energy at the user's port and what is noticed; what
    this adds to run.json; and the lines of its numbers."""

    record: RunRecord
    added: dict[str, Any]
    numbers: tuple[str, ...]


def find(results: Results) -> Findings:
    """What the tables of a run show."""
    measures = Measures(results)
    added: dict[str, Any] = {"user_port": measures.port, "warnings": [*lines(results, measures)]}
    if held := measures.held_contacts:
        added["held_contacts"] = held
    added["noticed"] = measures.noticed
    record = replace(results.record, **added)
    return Findings(record, plain(added), tuple(numbers(results, measures)))


def ending(results: Results) -> str:
    """How and when a run ended: `done at 3 s`."""
    end = results.record.end
    if end.time is None:
        return "not ended: it is still running, or its process was killed"
    if end.reason == "stop_when":
        return f"{describe_stop(results.record.stop_when)} at {end.time:.6g} s"
    how = {"terminated": f"ended: {end.asked},", "duration": "done"}
    return f"{how.get(end.reason, end.reason)} at {end.time:.6g} s"


def describe_stop(condition: str) -> str:
    """What the condition means that ended a run, in words where it is that of a device."""
    signal, _, limit = condition.partition(" < ")
    device, _, port = signal.partition(".")
    if port != WORKSPACE_MARGIN.partition(".")[2] or not limit or float(limit):
        return f"ended by {condition}"
    user = user_of_block(device, DEVICE)
    return f"the device{f' of {user}' if user else ''} left its workspace"


def warnings(results: Results) -> Sequence[str]:
    """The lines on warnings as they are recorded; computed where no row is in the folder, or too
    many to be read back."""
    recorded = results.record.warnings
    return [*lines(results)] if recorded is None else recorded


def print_lines(results: Results, name: str, known: Sequence[str] | None = None) -> Iterator[str]:
    """The lines that `hapticlink run` and `print` show of a run: how it ended, its numbers (those
    that are `known`), warnings, time and files."""
    yield f"{name}: {ending(results)}"
    recorded = warnings(results)
    doubtful = [line for line in recorded if line.startswith("warning: ")]
    for line in (
        *doubtful,
        *(numbers(results) if known is None else known),
        *(r for r in recorded if r not in doubtful),
    ):
        yield f"  {line}"
    record = results.record
    if record.timings.run and record.end.time:  # a signal may come before the first event
        speed = (record.end.time - record.begun) / record.timings.run
        yield f"  {record.timings.run:.2f} s of run time, {speed:.1f} times real time"
    if results.folder:
        files = sorted(record.files, key=lambda name: not name.endswith(TABLES))
        yield f"  {results.folder}/: {', '.join(files)}"


def numbers(results: Results, measures: Measures | None = None) -> Iterator[str]:
    """What one would open the figures for: tracking error, largest forces, energies, closure of the
    loops. measures: those of the results, if they are there."""
    measures = measures or Measures(results)
    yield from describe_experiment(results.record.scene)
    yield from describe_devices(results.record.scene)
    for user, error in measures.tracking.items():
        yield _tracking(user, error, turns=compares_angles(results, UserSignals.of(user)))
        if user and _left(results, UserSignals.of(user).margin):
            yield f"warning: the handle of {user} left its device's workspace, and its stops acted"
    if measures.forces:
        peaks = (f"{name} {short(force)} N" for name, force in measures.forces.items())
        yield f"largest forces: {'; '.join(peaks)}"
        yield from _describe_saturation(measures)
    yield from describe_noticed(measures.noticed)
    if port := measures.port:
        yield _energy(port, results.record.scene["record"]["every"])
    yield from describe_changes(results)
    for name, energy in results.record.across.items():
        if max(energy.peak, abs(energy.generated)) >= SMALLEST_J:
            yield f"held {name} {describe_generated(energy.peak, energy.generated)}"
    if held := measures.held_contacts:
        from hapticlink.analysis.findings.held_contacts import describe_held

        yield from describe_held(held)
    if measures.closure_m is not None:
        yield f"loops close within {measures.closure_m:.2g} m"


def _left(results: Results, margin: str) -> bool:
    table = of_block(results, margin)
    return table is not None and bool((table[margin] < 0).any())


def _tracking(user: str, error: TrackingError, *, turns: bool) -> str:
    """turns: whether the handle has an angle that is compared."""
    turned = f"; turned from it by at most {short(error.max_rad)} rad" if turns else ""
    if user:
        return f"handle of {user} at most {short(error.max_mm)} mm from its point{turned}"
    return (
        f"handle at most {short(error.max_mm)} mm from the operational point, "
        f"{short(error.rms_mm)} mm RMS{turned}"
    )


def _energy(port: PortEnergy, every: int) -> str:
    """A line on the energy at the user's port in one row of `every`, beside the work of the
    hands."""
    seen = f", in one row of {every}" if every > 1 else ""
    hands = [1e3 * work for name, work in port.works.items() if name.endswith("hand")]
    whose = name_hands(port)
    put_in = f"{whose} {describe_work(sum(hands))}, " if hands else ""
    this_is = "over" if port.peak > tolerated_energy(port.hand_work) else "within"
    generated = describe_generated(port.peak, port.generated, f", at {port.time_of_peak:.3g} s")
    return (
        f"energy at the user's port{seen}: {put_in}the rendering {generated}. A passive one "
        f"generates none; this is {this_is} the tolerated {allowance(port.hand_work, whose)}"
    )


def name_hands(port: PortEnergy) -> str:
    """Who puts energy in at the user's port: all hands that have a device, or act beside them."""
    several = sum(name.endswith("hand") for name in port.works) > 1
    return "the hands together" if several else "the hand"


def describe_work(millijoules: float, took: str = "took") -> str:
    """The work of a hand, which may be led: `put in 5 mJ`, or `took out`."""
    return f"{f'{took} out' if millijoules < 0 else 'put in'} {short(abs(millijoules))} mJ"


def describe_generated(peak: float, end: float, when: str = "") -> str:
    """What was generated (J): at most, at the time `when`, and by the end."""
    most, last = short(1e3 * peak), short(1e3 * abs(end))
    dissipated = f"dissipated {last} mJ"
    if peak < ROUNDING_J:
        none = "generated no energy"
        return f"{none} and {dissipated}" if end < -ROUNDING_J else none
    if end > 0 and most == last:
        return f"generated {last} mJ by the end, and at no time more"
    by_the_end = f"generated {last} mJ" if end > 0 else dissipated
    return f"generated at most {most} mJ{when}, and by the end has {by_the_end}"


def _describe_saturation(measures: Measures) -> Iterator[str]:
    """A line for each user whose motors were at their torque limit, and for how long."""
    for said, spans in groupby(measures.saturations, key=lambda episode: episode.said):
        seconds = sum(span.end - span.begin for span in spans)
        if seconds > 0:
            yield f"{said} for {short(seconds)} s: the hand felt less than the controller asked for"


def _describe_limited(results: Results) -> Iterator[str]:
    """A line where a board was sent less torque than the motor map gave over the step before."""
    asked, sent = (of_any_shape(results, port) for port in (MOTOR_TORQUES, APPLIED_TORQUES))
    if asked is None or sent is None:
        return
    ticks = np.abs(sent[APPLIED_TORQUES][1:]) < np.abs(asked[MOTOR_TORQUES][:-1])
    if n := int(ticks.any(axis=1).sum()):
        yield (
            f"at {n} of {len(ticks)} ticks the board was sent less torque than was asked for: its "
            "[device.driver] limits it (torque_limit, torque_rate)"
        )


def lines(results: Results, measures: Measures | None = None) -> Iterator[str]:
    """One line for each warning, which begins so, and for each note: start poses, folded copy,
    signals that are not recorded, held outputs, repeated steps, contacts, convergence, lost
    samples, stability, and holds that did not fit."""
    record, measures = results.record, measures or Measures(results)
    if resumed := record.resumed:
        since = record.scene.get("start_time", 0.0)
        yield (
            f"goes on from {resumed.state}, at {resumed.time:.6g} s: its rows are from then on, "
            f"energies of holds and counts from {since:g} s"
        )
    else:
        yield from _start(results)
    off, frames = measures.folded
    if off:
        remedy = ": take graphics.sync = 'exact'"
        if record.scene["local_model"]:
            remedy = ""  # its mechanism's loops are open: a copy that closes them is elsewhere
        yield (
            f"warning: the graphics copy was folded in {off} of {frames} frames, and with it "
            f"Lambda_inv, P_c and contacts{remedy}"
        )
    if record.unsaved:
        yield f"warning: {', '.join(record.unsaved)} not saved: the run ended before"
    yield from record.without_effect
    yield from describe_replacements(record.replaced)
    yield from _lacking(results)
    if find_handle(results) != HANDLE_POSE:
        yield (
            "the handle is told where the observer sees it: where a board's is, and the work of "
            "the hand on it, nobody knows"
        )
        yield from _describe_limited(results)
    yield from describe_unrecorded(record.not_recorded, record.fmus)
    if (every := record.scene["record"]["every"]) > 1:
        yield (
            f"reported and drawn from one row in {every} (record.every): what happens between "
            "them, such as larger forces and energies, is not seen"
        )
    for name in find_other_pushes(results):
        yield f"no energy at the user's port: {name} is not the force of the handle's own hand"
    yield from _steps(record)
    yield from friction_speed.coarse(results)
    yield from _passivity(results, measures)
    yield from _describe_stops(results)
    yield from _contacts(results, measures)
    yield from _idle_spins(results)
    for name, link in record.links.items():
        if link.lost or link.overtaken:
            yield (
                f"{name}: {link.lost} of {link.sent} samples were lost, {link.overtaken} overtaken"
            )
    if record.unstable:
        yield f"warning: {record.unstable}: the loop is not passive"
    yield from _describe_refused_holds(record)
    yield from model_premises.describe_premises(results)


def _steps(record: RunRecord) -> Iterator[str]:
    """Lines for outputs that were held, steps that did not converge or were too long, and what a
    run in real time was late with."""
    for fmu, count in record.held_outputs.items():
        yield f'{fmu}: {count} outputs were not finite and held (faults.nan = "hold")'
    for fmu, logged in record.logged.items():
        told = [f"{n} of {status}" for status, n in logged.items() if status != "ok"]
        if told:
            yield f"{fmu} has logged messages, {' and '.join(told)}: they are in fmus.log"
    if record.real_time:
        yield from _real_time(record.real_time)
    yield from model_premises.describe_computing_times(record)
    for fmu, exchange in record.network.items():
        yield from _network(fmu, exchange)
    if (counts := record.iterations) and counts.unconverged:
        yield f"warning: {counts.unconverged} of {counts.steps} iterated steps did not converge"
    for fmu, errors in record.step_errors.items():
        yield from long_steps(fmu, errors, record.fmus[fmu].block)


def _describe_refused_holds(record: RunRecord) -> Iterator[str]:
    """A line for each default hold that connections did not take."""
    by_hold: dict[str, list[tuple[str, str]]] = {}
    for name, refused in sorted(record.holds_that_did_not_fit.items(), key=lambda i: i[1].hold):
        reason = refused.reason.partition(":")[0]
        by_hold.setdefault(refused.hold, []).append((name.partition(" -> ")[2], reason))
    for hold, ports in by_hold.items():
        reasons = dict.fromkeys(reason for _, reason in ports)
        targets = ", ".join(target for target, _ in ports)
        yield f"zoh instead of the hold {hold} for {targets}: {'; '.join(reasons)}"


def _passivity(results: Results, measures: Measures) -> Iterator[str]:
    # casadi, for the torques of motors, which most of the terminal's lines can do without
    from hapticlink.analysis.findings import passivity_warnings

    yield from passivity_warnings.warn_of_passivity(results, measures)


def _describe_stops(results: Results) -> Iterator[str]:
    """A line if the passive midpoint method had to stop the mechanism, and one if contacts change
    its energy between steps."""
    table = of_block(results, MECHANISM_STOPS)
    if table and (results.record.scene["contacts"] or {}).get("detection") == "graphics":
        method = results.record.scene["mechanism"]["integrator"]
        yield (
            f"{method} makes no energy within a step, but each new frame of contacts may change "
            "it: take contacts.detection = 'haptics'"
        )
    if table and len(table["time"]) and (stops := int(table[MECHANISM_STOPS][-1])):
        yield (
            f"warning: virtual_mechanism was stopped in {stops} steps, which its energy did not "
            "allow: take more mechanism.substeps or a higher rate"
        )


def _contacts(results: Results, measures: Measures) -> Iterator[str]:
    if results.record.scene["contacts"]:
        from hapticlink.analysis.findings import contact_warnings, held_contacts

        yield from contact_warnings.warn_of_contacts(results)
        if held := measures.held_contacts:
            yield from held_contacts.warn_of_held(held)
        else:
            yield from held_contacts.why_unchecked(results)


def _idle_spins(results: Results) -> Iterator[str]:
    joints = (results.record.scene["linkage"] or {}).get("joint", ())
    if any(joint["type"] == "spherical" for joint in joints):
        from hapticlink.analysis.findings import idle_spins

        yield from idle_spins.warn_of_idle_spins(results)


def _real_time(report: Mapping[str, Any]) -> Iterator[str]:
    yield deadlines(report)
    if skipped := report.get("skipped"):
        yield f"{skipped} ticks were skipped, as hardware does not catch up with what is past"
    if moved := report["moved"]:
        yield (
            f"warning: the schedule was moved by {short(moved)} s in all: the machine was too "
            "slow, or suspended"
        )
    for clock, samples in report["samples"].items():
        if samples["late"]:
            late = f"{samples['late']} of {samples['taken']} samples were late"
            yield f"{clock}: {late}, at most by {short(1e3 * samples['largest_lateness'])} ms"
    for fmu, why in report["in_loop"].items():
        yield f"{fmu} ran in the haptic loop: {why}"


def deadlines(report: Mapping[str, Any]) -> str:
    """A sentence of the report of a run in real time (`RealTimeRun.report`), or of one without a
    clock whose samples arrive as those of another run did."""
    rate = short(1 / report["period"])
    if "arrivals" in report:
        return f"{rate} Hz without a clock; samples arrived as those of {report['arrivals']} did"
    missed = f"{report['deadlines_missed'] or 'none'} of {report['ticks']} deadlines missed"
    largest = (1e3 * report[name]["max"] for name in ("step_time", "lateness"))
    step, late = map(short, largest)
    speed = report["speed"]
    how = "in real time" if speed == 1.0 else f"at {short(speed)} times real time"
    return f"{rate} Hz {how}: {missed}; largest step time {step} ms, lateness {late} ms"


def _network(fmu: str, exchange: Mapping[str, Any]) -> Iterator[str]:
    """Lines on what was exchanged with the server of an FMU: delay and clock, and outages."""
    trip, clock = exchange["round_trip"], exchange["clock"]
    if clock:
        times = f"{short(1e3 * trip['p50'])} ms there and back, at most {short(1e3 * trip['max'])}"
        ahead = f"{short(1e3 * clock['offset'])} +- {short(1e3 * clock['offset_uncertainty'])} ms"
        yield f"{fmu}, at {exchange['server']}: {times}; its clock is ahead by {ahead}"
    if outages := exchange["outages"]:
        longest = short(max(length for _, length in outages))
        yield (
            f"warning: {fmu}: {len(outages)} outages of its server, at most {longest} s, in which "
            "held values went on"
        )


PULL = 5.0
"""A spring hand's first force (N) from which on its target is told not to be where it starts."""
APART, TURNED = 1e-3, 0.02
"""Distance (m) and angle (rad) of handle and operational point at the start that are told."""
SMALLEST_J = 1e-9
"""Energies below it have no line."""
ROUNDING_J = 1e-12
"""Energies below it are of sums that cancel."""

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
"""The signals of what is reported and drawn of a run."""


def describe_unrecorded(left_out: Collection[str], fmus: Iterable[str] = ()) -> Iterator[str]:
    """A line if signals that are not recorded are missing in what is reported and drawn of a run of
    these FMUs."""
    users = ["", *(user for name in fmus if (user := user_of_block(name, HAND)))]
    missing = {
        what: [
            s for user in users for name in names if (s := signal_of_user(name, user)) in left_out
        ]
        for what, names in USED.items()
    }
    parts = [f"{what} ({', '.join(signals)})" for what, signals in missing.items() if signals]
    if parts:
        yield (
            f"not recorded in every row, and so not reported or drawn in full: {'; '.join(parts)} "
            "(record.signals)"
        )


LARGEST_PERCENT = 1000
LARGEST_STEP_ERROR, LARGEST_SUM = 0.1, 0.1
"""Bounds of the relative error of a step, which may be an impact, and of the sum over all steps of
the mechanism (`step_check`); the controller takes back what would add up in the device."""


def long_steps(fmu: str, errors: StepErrors, block: str | None) -> Iterator[str]:
    """A line if the steps of an FMU were too long for its equations."""
    if errors.largest <= LARGEST_STEP_ERROR and (errors.sum <= LARGEST_SUM or block != MECHANISM):
        return
    key = {MECHANISM: "more mechanism.substeps or ", DEVICE: "more device.substeps or "}
    yield (
        f"warning: steps of {fmu} are too long: with half of them {errors.output} changes by "
        f"{_percent('up to', errors.largest)} of its largest value in one (at {errors.time:.4g} "
        f"s), and by {_percent('about', errors.sum)} in all: take {key.get(block or '', '')}a "
        "higher rate"
    )


def _percent(how: str, share: float) -> str:
    """A share, which says nothing any more beyond LARGEST_PERCENT."""
    percent = 100 * share
    far = percent > LARGEST_PERCENT
    return f"more than {LARGEST_PERCENT} %" if far else f"{how} {float(f'{percent:.2g}'):g} %"


def describe_replacements(replacements: Mapping[str, Replacement]) -> Iterator[str]:
    """Lines for the ports that FMUs in the place of blocks call otherwise or lack, and for their
    inputs that nothing feeds."""
    for name, replacement in replacements.items():
        for port, own in replacement.mapped.items():
            yield f"{name}: {port} is what the FMU calls {', '.join(own)}"
        if lost := replacement.lost:
            yield f"{name} has no ports for {len(lost)} connections: {', '.join(lost)}"
        if unfed := replacement.unfed:
            yield f"{name}: inputs that nothing feeds: {', '.join(unfed)}"
        if lost and unfed:
            yield f"{name}: --map 'PORT={unfed[0]}', with a port of {name}, connects such an input"


LACKED = {
    WORKSPACE_MARGIN: "that the handle leaves its workspace is not seen",
    MECHANISM_ENERGY: "there is no energy at the user's port",
}
"""What is not known of a run without an output of one of the blocks."""


def _lacking(results: Results) -> Iterator[str]:
    """A line for each such output that an FMU in the place of a block does not have."""
    record = results.record
    for signal, what in LACKED.items():
        name, _, output = signal.partition(".")
        there = signal in record.not_recorded or of_block(results, signal)
        if name in record.replaced and not there:
            yield f"{name} has no {output}: {what}"


def _start(results: Results) -> Iterator[str]:
    device = of_block(results, WORKSPACE_MARGIN)
    if (
        device
        and of_port(results, HANDLE_POSE)
        and len(device["time"])
        and device.start[WORKSPACE_MARGIN][0] < 0
        and not results.record.fault
    ):
        point = of_port(results, POINT_POSE)  # which the device may not reach
        start = point.start[POINT_POSE][0] if point else device.start[HANDLE_POSE][0]
        yield f"warning: {describe_start_outside(space_of(results), start)}"
    yield from _start_apart(results)
    pulls = of_port(results, HAND_WRENCH)
    if (results.record.scene["hand"] or {}).get("type") == "spring" and pulls:
        pull = float(space_of(results).distance(pulls.start[HAND_WRENCH]).max(initial=0.0))
        if pull > PULL:
            yield (
                f"warning: the hand's spring begins with a pull of {short(pull)} N: begin "
                "hand.target where the handle starts, which `hapticlink info` prints"
            )
    linkage = results.record.scene["linkage"]
    if not linkage:
        return
    size = sum(JOINT_TYPES[joint["type"]].size for joint in linkage["joint"])
    table = of_block(results, JOINT_COORDINATES, size)
    if table and len(table["time"]):
        yield from describe_assembly(linkage, table.start[JOINT_COORDINATES][0])


def _start_apart(results: Results) -> Iterator[str]:
    """A line for a handle that starts elsewhere than the operational point, as a device of others
    may."""
    handle, point = of_port(results, HANDLE_POSE), of_port(results, POINT_POSE)
    if handle and point and len(handle["time"]) and len(point["time"]):
        off, space = handle.start[HANDLE_POSE][0] - point.start[POINT_POSE][0], space_of(results)
        far, turned = float(space.distance(off)), float(space.angle(off))
        if far > APART or turned > TURNED:
            yield (
                f"warning: the handle starts {short(1e3 * far)} mm and {short(turned)} rad from "
                "the operational point: errors contain that"
            )


def describe_assembly(linkage: Mapping[str, Any], q: Sequence[float]) -> Iterator[str]:
    """A line with both poses if assembly moved joints far from their start in [linkage]; q are the
    assembled joint coordinates."""
    starts = linkage["start"]
    given = {name: np.atleast_1d(start).tolist() for name, start in starts.items()}
    poses, far, coordinates = {}, [], iter(q)
    for joint in linkage["joint"]:
        name, kind = joint["name"], JOINT_TYPES[joint["type"]]
        poses[name] = list(islice(coordinates, kind.size))
        starts = _shorter(given[name], kind.balls) if name in given else ()
        for start, value, unit in zip(starts, poses[name], kind.units, strict=False):
            if abs(value - start) > SMALLEST_MOVE[unit]:
                far.append(f"{name} by {_turn(value - start, unit)}")
    if far:
        yield (
            f"warning: the loops do not close at the given start; assembly moved {', '.join(far)}. "
            f"Given: {_pose(given)}. Assembled: {_pose({name: poses[name] for name in given})}"
        )


def _shorter(start: Sequence[float], balls: Sequence[int]) -> Sequence[float]:
    """Joint coordinates with the shorter vector of each ball, which a run has."""
    if not balls:
        return start
    import casadi as ca  # slow to load

    from hapticlink.components.linkage.rotations import shorten

    return list(
        map(float, ca.evalf(shorten(ca.SX([*start]), ca.SX(len(start), 1), balls)[0]).elements())
    )


def _turn(change: float, unit: str) -> str:
    return f"{np.degrees(change):.3g} degrees" if unit == "rad" else f"{1e3 * change:.3g} mm"


def _pose(coordinates: Mapping[str, Sequence[float]]) -> str:
    """As `linkage.start` is written."""
    values = {name: [f"{v:.6g}" for v in value] for name, value in coordinates.items()}
    texts = (v[0] if len(v) == 1 else f"[{', '.join(v)}]" for v in values.values())
    pairs = zip(values, texts, strict=True)
    return f"linkage.start = {{ {', '.join(f'{name} = {text}' for name, text in pairs)} }}"


SMALLEST_MOVE = {"rad": 0.1, "m": 0.01}
"""Joints that assembly moved by less are not reported."""
