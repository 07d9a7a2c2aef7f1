"""Warnings where the energy bound of passive holds, tanks and passivity controllers does not apply:
they assume that a force acts over the motion right after its sample, which a late or saturated
force does not."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import groupby
from typing import Any

from hapticlink.analysis.findings.episodes import Episode
from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.tracking import (
    UserSignals,
    find_measured_handle,
    of_block,
    of_port,
)
from hapticlink.components.specs.control import PassivityLaw
from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    PASS_ON,
    block_of_user,
    user_of_block,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import all_devices


def warn_of_passivity(results: Results, measures: Measures) -> Iterator[str]:
    """A line for each late force and pose of a passivity controller or of `pspm`, for motors at
    their limit beside a passivity controller, for one that damps counts of encoders, and for energy
    that was generated outside the premises."""
    record = results.record
    yield from _outside(results)
    late = {name: age.max for name, age in record.delays.items() if age.max > 0.0}
    guarded = _find_guarded(record.scene)
    for name, age in late.items():
        source, target = name.split(" -> ")
        if _is_one(source, guarded, ("F_motor", "F")):
            yield (
                f"warning: {name} acts {short(1e3 * age)} ms late: the passivity controller "
                "pairs it with the motion since its sample, and does not bound its energy"
            )
        if _is_one(target, guarded, ("x_D", "x")):
            yield (
                f"warning: {name} is {short(1e3 * age)} ms old: the passivity controller pairs "
                "its force with the motion of that time, and does not bound its energy"
            )
    driven = [name for name in guarded if user_of_block(name, CONTROLLER) is not None]
    for name, spans in groupby(measures.saturations if driven else (), key=_controller):
        if name in driven:
            seconds = sum(span.end - span.begin for span in spans)
            yield (
                f"warning: the motors of {name} were at their limit for {short(seconds)} s: its "
                "passivity controller counts forces that they do not reach, and does not bound "
                "their energy"
            )
    if record.scene["sensing"] == "encoders":
        yield from _counts(results)
    yield from _set_positions(results, late)


MATTERS = 0.05
"""Energy, as a share of what the hands put in, from which steps outside the premises matter."""
LEAST_J = 1e-6


def _outside(results: Results) -> Iterator[str]:
    """A line for each hold, tank and passivity controller that gave more energy than its theorem
    allows, where that matters beside what the hands put in."""
    record = results.record
    put_in = sum(
        max(energy.ideal, 0.0)
        for name, energy in record.meters.items()
        if all(user_of_block(_fmus(name)[0], block) is None for block in PASS_ON)
    )
    matters = MATTERS * put_in + LEAST_J
    shared = {*map(_fmus, (name for name, J in record.overdrawn.items() if J > 0.0))}
    counted = {
        name: f"{short(100 * p.outside / p.steps)} % of the steps were not as it foresees, in "
        f"which {short(1e3 * p.at_stake)} mJ were at stake"
        for name, p in record.premises.items()
        if p.outside
    }
    for name, J in record.overdrawn.items():
        if matters < J:
            back = [said for n, said in counted.items() if _fmus(n)[::-1] == _fmus(name)]
            yield (
                f"warning: pspm of {name} was overdrawn by {short(1e3 * J)} mJ, where hands put in "
                f"{short(1e3 * put_in)} mJ: {'; '.join(back) or 'sampling gave them'}; take a "
                "higher rate, or weaker gains of the coupling"
            )
    for name, said in counted.items():
        generated = record.meters[name].peak if name in record.meters else 0.0
        if (
            min(generated, record.premises[name].at_stake) > matters
            and _fmus(name)[::-1] not in shared
        ):
            yield (
                f"warning: {record.holds[name]} of {name} generated {short(1e3 * generated)} mJ, "
                f"where hands put in {short(1e3 * put_in)} mJ: {said}; take a higher rate"
            )
    for user in _laws(record.scene):
        table = of_block(results, user.passivity_energy)
        least = float(table[user.passivity_energy].min()) if table and len(table["time"]) else 0.0
        if -least > matters:
            yield (
                f"warning: the motors of {user.controller} gave "
                f"{short(-1e3 * least)} mJ beyond the budget of its passivity controller, where "
                f"hands put in {short(1e3 * put_in)} mJ: its damping is at its limit, or acts on "
                "motion above its noise alone; take a higher rate, or weaker gains"
            )


def _find_guarded(scene: Mapping[str, Any]) -> list[str]:
    """The FMUs with a passivity controller."""
    walls = [
        fmu["name"]
        for fmu in scene.get("fmu", ())
        if fmu.get("block") == "virtual_wall" and fmu.get("settings", {}).get("passivity")
    ]
    return [*(user.controller for user in _laws(scene)), *walls]


def _laws(scene: Mapping[str, Any]) -> dict[UserSignals, PassivityLaw]:
    """The passivity controllers of the users who have one."""
    own = scene["controller"] or {}
    laws = {"": own} | {name: scene["controllers"].get(name, own) for name in scene["devices"]}
    given = {user: law["passivity"] for user, law in laws.items() if law.get("passivity")}
    return {
        UserSignals.of(user): PassivityLaw(**({} if law is True else law))
        for user, law in given.items()
    }


def _counts(results: Results) -> Iterator[str]:
    """A line for each passivity controller that damps single counts of the encoders."""
    from hapticlink.components.device.motors_and_encoders import count_energies  # casadi

    record = results.record
    laws, devices = _laws(record.scene), all_devices(results)
    for user, law in laws.items():
        handle, device = find_measured_handle(results, user), devices.get(user.name)
        table = of_port(results, handle) if handle else None
        if handle is None or table is None or device is None or not len(table["time"]):
            continue
        damped = of_block(results, user.passivity_damping)
        if damped and not damped[user.passivity_damping].any():
            continue
        period = record.clocks[record.fmus[handle.partition(".")[0]].rate].longest
        count = float(count_energies(device, table[handle][0], period).max())
        if law.noise < count:
            key = f"controllers.{user.name}" if user.name else "controller"
            yield (
                f"warning: {key}.passivity.noise is {law.noise:g} J, and one count of an encoder "
                f"in a period {short(count)} J: the passivity controller damps counts, which give "
                f"no energy; fewer of them, and with a looser bound, from {key}.passivity.noise="
                f"{1.1 * count:.2g}"
            )


def _controller(saturated: Episode) -> str:
    """The controller of the motors that were at their limit, by the user's name."""
    user = saturated.said.partition(": ")[2]
    return block_of_user(CONTROLLER, user)


def _is_one(port: str, fmus: Collection[str], names: tuple[str, ...]) -> bool:
    fmu, _, name = port.partition(".")
    return fmu in fmus and name in names


def _set_positions(results: Results, late: Mapping[str, float]) -> Iterator[str]:
    """A line for each late force from an FMU whose spring `pspm` sets to either end of it."""
    record = results.record
    feeds = {_fmus(name) for name in record.connections}
    set_by = {_fmus(name)[::-1] for name, hold in record.holds.items() if hold == "pspm"}
    forces = {spring["force"] for spring in record.scene["spring"]}
    for name, age in late.items():
        spring, end = _fmus(name)
        works = name in record.meters or name.partition(" -> ")[0] in forces
        if not works or spring not in {fmu for fmu, _ in set_by} or (end, spring) not in feeds:
            continue
        if (spring, end) not in set_by:
            yield (
                f"warning: {name} acts {short(1e3 * age)} ms late: pspm counts the force over the "
                "motion since its sample, and does not bound its energy"
            )
        elif name in record.latencies and record.holds.get(name) in ("passive", "nepce"):
            yield (
                f"pspm of {spring} does not count {name}, which has a latency: it bounds the "
                "energy given to the near side alone, not to both"
            )


def _fmus(connection: str) -> tuple[str, str]:
    """The FMUs of a connection."""
    source, _, target = connection.partition(" -> ")
    return source.partition(".")[0], target.partition(".")[0]
