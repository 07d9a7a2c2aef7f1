"""Warnings of what takes the bound from a passivity controller or from `pspm`, which count the
energy of a force over the motion that follows its sample."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import groupby
from typing import Any

from hapticlink.orchestrator.results.episodes import Episode, saturations
from hapticlink.orchestrator.results.figure_axes import short
from hapticlink.orchestrator.results.port_blocks import meters
from hapticlink.orchestrator.results.tables import Results


def lines(results: Results) -> Iterator[str]:
    """A line for each late force and pose of a passivity controller or of `pspm`, and for motors at
    their limit beside a passivity controller."""
    run = results.run
    late = {name: age["max"] for name, age in run["delays"].items() if age["max"] > 0.0}
    guarded = _guarded(run)
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
    driven = [name for name in guarded if name.startswith("controller")]
    for name, spans in groupby(saturations(results) if driven else (), key=_controller):
        if name in driven:
            seconds = sum(span.end - span.begin for span in spans)
            yield (
                f"warning: the motors of {name} were at their limit for {short(seconds)} s: its "
                "passivity controller counts forces that they do not reach, and does not bound "
                "their energy"
            )
    yield from _set_positions(results, late)


def _guarded(run: Mapping[str, Any]) -> list[str]:
    """The FMUs with a passivity controller."""
    scene = run["scene"]
    own = scene["controller"] or {}
    users = {f"controller_{n}": scene["controllers"].get(n, own) for n in scene["devices"]}
    found = [name for name, law in ({"controller": own} | users).items() if law.get("passivity")]
    for fmu in scene.get("fmu", ()):
        if fmu.get("block") == "virtual_wall" and fmu.get("settings", {}).get("passivity"):
            found.append(fmu["name"])
    return found


def _controller(saturated: Episode) -> str:
    """The controller of the motors that were at their limit, by the user's name."""
    user = saturated.said.partition(": ")[2]
    return f"controller_{user}" if user else "controller"


def _is_one(port: str, fmus: Collection[str], names: tuple[str, ...]) -> bool:
    fmu, _, name = port.partition(".")
    return fmu in fmus and name in names


def _set_positions(results: Results, late: Mapping[str, float]) -> Iterator[str]:
    """A line for each late force from an FMU whose spring `pspm` sets to either end of it."""
    run, powers = results.run, meters(results)
    set_by: dict[str, set[str]] = {}
    for name, hold in run["holds"].items():
        source, _, target = name.partition(" -> ")
        if hold == "pspm":
            set_by.setdefault(target.partition(".")[0], set()).add(source.partition(".")[0])
    for name, age in late.items():
        source, target = (end.partition(".")[0] for end in name.split(" -> "))
        if source not in set_by or name not in powers:
            continue
        if target not in set_by[source]:
            yield (
                f"warning: {name} acts {short(1e3 * age)} ms late: pspm counts the force over the "
                "motion since its sample, and does not bound its energy"
            )
        elif name in run["latencies"] and run["holds"].get(name) in ("passive", "nepce"):
            yield (
                f"pspm of {source} does not count {name}, which has a latency: it bounds the "
                "energy given to the near side alone, not to both"
            )
