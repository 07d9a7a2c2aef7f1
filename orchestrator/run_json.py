"""The contents of run.json: scene, versions, rates, holds, links, energies and the end of a run."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from hapticlink.fmus.versions import version
from hapticlink.orchestrator.base import plugins
from hapticlink.orchestrator.base.loop_names import MECHANISM
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import causal
from hapticlink.orchestrator.run.energy.balance import unstable
from hapticlink.orchestrator.run.energy.meter import Energy
from hapticlink.orchestrator.run.event_loop import Outcome
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.rates import VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system import held_polynomials
from hapticlink.orchestrator.system.ports import carries_power
from hapticlink.orchestrator.system.system import System


def clocks(timeline: Timeline) -> dict[str, Any]:
    """For each clock, its first step and the shortest and longest after it (s)."""
    seconds = timeline.seconds
    return {
        c.name: {
            "first": seconds(c.first),
            "shortest": seconds(c.shortest),
            "longest": seconds(c.longest),
        }
        for c in timeline.clocks
    }


def holds(system: System) -> dict[str, Any]:
    """Holds, kinds, latencies and substeps by connection or FMU, and how plants take held inputs
    that vary within a step."""
    held = [c for c in system.connections if c.hold]
    return {
        "holds": {c.name: c.hold for c in held},
        "holds_that_did_not_fit": {
            r.connection.name: {"hold": r.hold, "reason": r.reason} for r in system.refused
        },
        "held_as": {c.name: c.kind for c in held if c.kind},
        "latencies": {c.name: asdict(c.latency) for c in held if c.latency},
        "substeps": {u.name: system.substeps.get(u.name, 1) for u in system.fmus if not u.sampled},
        "within_a_step": within_a_step(system),
        "get_after_set": list(system.get_after_set),
        "power_across_rates": power_across_rates(system),
    }


def within_a_step(system: System) -> dict[str, str]:
    """For each hold that varies within a step, how its plant takes it."""
    return {
        c.name: _taken(held_polynomials.order(system, c), system.substeps.get(c.target, 1))
        for c in system.connections
        if held_polynomials.degree(system, c)
    }


def _taken(order: int, substeps: int) -> str:
    if order:
        renewed = f", renewed in {substeps} substeps" if substeps > 1 else ""
        return f"derivatives to order {order}{renewed}"
    if substeps > 1:
        return f"constant in each of {substeps} substeps"
    return "constant, the hold at the middle (half-step lead)"


def power_across_rates(system: System) -> list[str]:
    """Names of the connections that carry power across rates."""
    return [
        c.name
        for c in system.connections
        if carries_power(c, system.power)
        and system.fmu[c.source].clock != system.fmu[c.target].clock
    ]


def energies(system: System, booked: Mapping[str, Energy]) -> dict[str, Any]:
    """Energies (J) of connections across rates, "none" where none carries power, and of connections
    within a rate, whose inputs are held over the target's step, too."""
    across = set(power_across_rates(system))
    return {
        "energies": {n: asdict(e) for n, e in booked.items() if n in across} or "none",
        "energies_within_a_rate": {n: asdict(e) for n, e in booked.items() if n not in across},
    }


def _story(scene: Scene, plan: Plan, tables: Iterable[str]) -> dict[str, Any]:
    """What is known before the run; `tables` are the clocks that have one."""
    system, base = plan.system, plan.system.timeline.base
    return {
        "scene": scene.tables(),
        "options": list(scene.source.options) if scene.source else [],
        "versions": {name: version(name) for name in (*PACKAGES, *_compilers(scene))}
        | {"python": platform.python_version()},
        "plugins": plugins.loaded(),
        "seeds": _seeds(scene, system),
        "files": ["run.json", *(f"{clock}.{scene.record.format}" for clock in tables)],
        "rates": [c.name for c in system.timeline.clocks],
        "clocks": clocks(system.timeline),
        "stop_when": str(system.ends_when or ""),
        "base": f"{base.numerator}/{base.denominator} s",
        "fmus": {
            u.name: {
                "rate": u.clock,
                "timing": u.description.timing,
                "block": system.block(u.name),
            }
            for u in system.fmus
        },
        "friction_speeds": _friction_speeds(scene, system),
        "coupling": system.coupling,
        "loops": [asdict(loop) for loop in plan.loops()],
        "connections": [c.name for c in system.connections],
        "replaced": {name: asdict(r) for name, r in system.replacements.items()},
    } | holds(system)


def _friction_speeds(scene: Scene, system: System) -> dict[str, float]:
    """v_f (rad/s or m/s) of the mechanism's joints with friction, by name."""
    if MECHANISM not in system.fmu or not (scene.linkage and scene.linkage.rubbing):
        return {}
    from hapticlink.components.dynamics import friction_scale  # loads CasADi

    timeline = system.timeline
    period = timeline.seconds(timeline.clock(system.fmu[MECHANISM].clock).longest)
    return friction_scale.speeds(scene.linkage, period / scene.mechanism.substeps)


def _compilers(scene: Scene) -> tuple[str, ...]:
    return ("ziglang",) if scene.packaging == "native" and blocks(scene) else ()


def _seeds(scene: Scene, system: System) -> dict[str, int]:
    rates = {"graphics.rate": scene.graphics.rate} if scene.graphics else {}
    rates |= {f"fmu.{fmu.name}.rate": fmu.rate for fmu in scene.fmu if fmu.rate}
    seeds = {name: r.seed for name, r in rates.items() if isinstance(r, VariableRate)}
    return seeds | {c.name: c.latency.seed for c in system.connections if c.latency}


def _ending(system: System, outcome: Outcome, built: float) -> dict[str, Any]:
    fault = outcome.fault
    failed = fault and {
        "kind": type(fault).__name__,
        "time": getattr(fault, "time", None),
        "message": str(fault),
    }
    return {
        "end": {"reason": outcome.reason, "time": outcome.end_time}
        | ({"asked": outcome.asked} if outcome.asked else {}),
        "fault": failed,
        "calls": outcome.calls,
        "delays": {name: asdict(age) for name, age in outcome.delays.items()},
        "causal": causal(outcome.delays),
        "links": outcome.links,
        "isolated": outcome.isolated,
        "held_outputs": outcome.held,
        "smaller_steps": outcome.smaller_steps,
        "in_python": outcome.in_python,
        "real_time": outcome.real_time,
        "timings": {
            "build": built,
            "run": outcome.wall_time,
            "tables": outcome.table_time,
            "steps": outcome.step_time,
        },
        "iterations": outcome.iterations and asdict(outcome.iterations),
        "unstable": unstable(system, outcome.energies),
        "step_errors": {name: asdict(errors) for name, errors in outcome.step_errors.items()},
        "controlled_steps": {clock: asdict(steps) for clock, steps in outcome.steps.items()},
    } | energies(system, outcome.energies)


PACKAGES = ("hapticlink", "casadi", "fmpy", "pythonfmu", "numpy")
