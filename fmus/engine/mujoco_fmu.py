"""Blocks of the haptic loop by a physics engine, as FMUs with the ports of our own.

MuJoCo gets the linkage, and what it can touch, as a model made from the scene (`mjcf.py`), and
gives mobility, constrained directions and motion (`mujoco_functions.py`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.components.component import Component, Variable
from hapticlink.fmus.engine.mjcf import HAND, chain, coordinates, mjcf, offset, points
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.python_fmu_entries import pack_entries

INTEGRATORS = {
    "semi-implicit-euler": "Euler",
    "linearly-implicit": "implicitfast",
    "rk4": "RK4",
}
"""MuJoCo's methods by those of a mechanism."""
PARAMETERS = ("q_start", "qd_start", "K_g", "B_g", "length_scale", "rank_tolerance", "hysteresis")
LEFT_OUT = ("energy", "lambda", "rank", "condition", "stops")
"""Outputs that our blocks have besides."""
DOCUMENTATION = """
The block by MuJoCo, with the ports of the one that it replaces. Masses and geometry are those of
the model in resources/model.xml; there are no parameters for them.

The mobility is J A J', with the engine's Jacobians and mass matrix M, where A Q are the
accelerations by forces Q that the closures allow:

    A Q = M^-1 (Q - W' (W M^-1 W')^+ W M^-1 Q)
"""


def entries(
    component: Component, settings: Mapping[str, Any], **experiment: float
) -> dict[str, bytes]:
    """All files of the FMU of `component` by MuJoCo; `settings` are those of its block, experiment
    as of `describe_component`. Raises FmuError, with the remedy, where mujoco is not
    installed and for what it does not hold."""
    if find_spec("mujoco") is None:
        raise FmuError('engine = "mujoco" needs MuJoCo: pip install "hapticlink[engine]"')
    for why in _misfits(component, settings):
        raise FmuError(f'{component.name} with engine = "mujoco": {why}')
    linkage, contacts = settings["linkage"], settings.get("contacts")
    mechanism = settings.get("mechanism")
    sync = None if mechanism else settings["graphics"].sync
    integrator = INTEGRATORS[mechanism.integrator] if mechanism else "Euler"
    reduced = _reduce(component)
    about = {
        "block": component.name,
        "sync": sync,
        "coordinates": coordinates(linkage),
        "points": [
            (name, "" if name == HAND else f"{name}.", chain(linkage, body))
            for name, body, _ in points(linkage)
        ],
        "loops": len(linkage.loop),
        "gears": [(g.joints, g.ratio, offset(linkage, g)) for g in linkage.gear],
        "contact": (contacts.stiffness, contacts.damping) if contacts else (1.0, 1.0),
        "margin": contacts.margin if contacts else 0.0,
        "limits": [
            (j.name, j.limits.stiffness, j.limits.damping or 0.0) for j in linkage.joint if j.limits
        ],
        "felt": bool(settings.get("felt")),
        "inputs": _sizes(reduced.inputs),
        "parameters": _sizes(reduced.parameters),
        "outputs": _sizes(reduced.outputs),
    }
    functions = {
        "resources/model.xml": mjcf(
            linkage, contacts, integrator, pulled=sync == "operational"
        ).encode(),
        "resources/engine.json": json.dumps(about).encode(),
    }
    module = Path(__file__).with_name("mujoco_functions.py").read_bytes()
    return pack_entries(reduced, functions, {"n_shared": 0}, module, **experiment)


def _misfits(component: Component, settings: Mapping[str, Any]) -> Iterator[str]:
    """What the engine's block does not do, each with the remedy."""
    if component.name not in ("virtual_mechanism", "virtual_environment"):
        yield "it is the engine of virtual_mechanism and virtual_environment"
    names = {v.name for v in (*component.inputs, *component.outputs)}
    if settings["linkage"].choices:
        yield "it holds one point: take linkage.points out and give linkage.operational_point"
    if "D" in names:
        yield "D, W, w and J_h are not passed on: take local_model = false"
    if "contacts" in names:
        yield 'rows of contacts are not passed on: take contacts.detection = "haptics"'
    mechanism, graphics = settings.get("mechanism"), settings.get("graphics")
    if mechanism and mechanism.integrator not in INTEGRATORS:
        yield f"integrator {mechanism.integrator!r} is not MuJoCo's: take one of {[*INTEGRATORS]}"
    if graphics and graphics.sync == "joint":
        yield 'sync = "joint" is not passed on: take graphics.sync = "exact" or "operational"'
    if graphics and graphics.sync == "operational":
        for key, (along_x, along_y, _) in (
            ("stiffness", graphics.stiffness),
            ("damping", graphics.damping),
        ):
            if along_x != along_y:
                yield f"graphics.{key} differs along x and y: give one value for both"
        if not all(graphics.stiffness):
            yield "graphics.stiffness holds a 0, and the pull is a spring: give it stiffness"
    if any(j.limits and j.limits.restitution is not None for j in settings["linkage"].joint):
        yield "restitution of joint limits is not passed on: give their damping"


def _sizes(variables: Iterable[Variable]) -> dict[str, int]:
    return {v.name: v.size for v in variables}


def _reduce(component: Component) -> Component:
    """The component with the ports, parameters and states that the engine's block has. Its
    functions give the structure of dependencies alone; it starts at the assembled pose."""
    x0 = np.array(component.initialize(component.start_inputs, component.start_parameters)).ravel()
    n = next(v.size for v in component.states if v.name == "q")
    assembled = {"q_start": tuple(x0[:n]), "qd_start": tuple(x0[n : 2 * n])}
    parameters = tuple(
        replace(v, start=assembled.get(v.name, v.start))
        for v in component.parameters
        if v.name in PARAMETERS
    )
    outputs = tuple(v for v in component.outputs if v.name not in LEFT_OUT)
    u = ca.SX.sym("u", len(component.start_inputs))
    x = ca.SX.sym("x", sum(v.size for v in component.states))
    p, t = ca.SX.sym("p", sum(v.size for v in parameters)), ca.SX.sym("t")
    by_name = {name: p[i] for i, name in enumerate(name for v in parameters for name in v.names)}
    known = [
        by_name.get(name, start)
        for v in component.parameters
        for name, start in zip(v.names, v.starts, strict=True)
    ]
    every = ca.vertcat(ca.SX(0, 1), *known)
    names = [name for v in component.outputs for name in v.names]
    chosen = [names.index(name) for v in outputs for name in v.names]
    counts = ("q", "qd", "n_constrained")
    states = tuple(v for v in component.states if v.name.split(".")[-1] in counts)
    return replace(
        component,
        description=f"{component.description}, by MuJoCo",
        parameters=parameters,
        outputs=outputs,
        states=states,
        initialize=ca.Function("initialize", [u, p], [component.initialize(u, every)]),
        output=ca.Function("output", [x, u, p, t], [component.output(x, u, every, t)[chosen]]),
        documentation=DOCUMENTATION,
        springs=(),
        look_ups=(),
        state_notes={},
    )
