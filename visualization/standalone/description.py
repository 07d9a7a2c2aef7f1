"""What a page without a server is told of its scene: what the server would send, and where the
program has what frames show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import casadi as ca

from hapticlink.orchestrator.base.signal_names import CHOSEN_POINT, MECHANISM_ENERGY
from hapticlink.orchestrator.scene.blocks import described_devices
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.changes import result_after
from hapticlink.programs.page_program import Drawing
from hapticlink.programs.ports import Port
from hapticlink.programs.prepared_changes import LEAST_RATE, MOST_DELAY
from hapticlink.programs.resolve_scene import Resolved
from hapticlink.visualization.live_and_standalone import first_messages
from hapticlink.visualization.live_and_standalone.choose_model import MODEL, options
from hapticlink.visualization.live_and_standalone.offered_controls import (
    CLOCK,
    RANGES,
    Offered,
    stiffness,
    target,
    users,
)
from hapticlink.visualization.mechanism.frame_signals import outputs
from hapticlink.visualization.mechanism.picture import RAW, Part, Picture

PREPARED = RANGES | {"graphics": (LEAST_RATE, RANGES["graphics"][1]), "delays": (0.0, MOST_DELAY)}
"""For what a program is prepared."""
Places = Mapping[str, Mapping[str, Sequence[int]]]
"""By user and name in a frame, the indices of its signal in the vector of signals."""


class PageDescription:
    """data: as JSON has it, for program.js. drawing: what the program computes of its signals."""

    def __init__(self, program: Resolved, ports: Sequence[Port], name: str) -> None:
        scene, system = program.scene, program.system
        assert scene.linkage
        picture = Picture(scene.linkage, described_devices(scene), scene.contacts)
        places, offered = _places(program), Offered(scene, system, ranges=PREPARED)
        parts = [p for p in picture.parts if {*p.needs} <= {*places.get(p.user, {})}]
        self.drawing = _drawing(parts, places)
        if program.changes.clock < 0:
            offered.rate = None
        references: dict[str, list[int]] = {}
        for reference, port in enumerate(ports):
            references.setdefault(port.name.partition("[")[0], []).append(reference)
        self.parameters = {name: value.tolist() for name, (value, _) in offered.gains.items()}
        """The gains with which the page begins, with all hands pulling where the handles are."""
        for user, signals in places.items():
            handle = [float(program.start_values[place]) for place in signals["handle"]]
            self.parameters[target(user)] = handle
        hands = {u: {"stiffness": stiffness(u), "target": target(u)} for u in users(scene)}
        chosen = [*offered.gains, *(hand["target"] for hand in hands.values())]
        chosen += [CHOSEN_POINT] if scene.linkage.choices else []
        self.data: dict[str, Any] = {
            "name": name,
            "scene": first_messages.describe_viewed_run(scene, system, program.meters)
            | first_messages.describe_picture(picture),
            "controls": [*_controls(offered, scene)],
            "result_after": result_after(system, CLOCK),
            "topology": offered.topology,
            "hands": hands,
            "point": CHOSEN_POINT,
            "parameters": {name: references[name] for name in chosen},
            "choices": [
                {"connection": c.connection, "hold": c.hold} for c in program.changes.choices
            ],
            "signals": [
                {"user": user, "name": key, "places": [*indices]}
                for user, signals in places.items()
                for key, indices in signals.items()
                if key not in RAW
            ],
            "parts": [*_lay_out(parts)],
            "stored": program.simulation.signals.scalar(*MECHANISM_ENERGY.split(".")),
            "n_values": len(program.simulation.signals.values),
            "n_drawn": self.drawing.function.nnz_out(),
            "tables": [{"columns": _columns(program, clock)} for clock in program.tables],
        }


def _controls(offered: Offered, scene: Scene) -> Iterator[dict[str, Any]]:
    """The controls as a program has them, whose plan is that of the start."""
    for control in offered.described({}):
        if control["key"] == MODEL:
            changed = options(scene, not control["value"])
            control["only_at_start"] = " ".join(f"--set {option}" for option in changed)
        yield control


def _places(program: Resolved) -> Places:
    """The signals that frames of a scene show."""
    fmus, signals = program.system.fmu, program.simulation.signals
    by_user = {}
    for user in users(program.scene):
        by_user[user] = {
            key: signals.port(fmus[output.partition(".")[0]], output.partition(".")[2])
            for key, output in outputs(fmus, user).items()
        }
    return by_user


def _drawing(parts: Sequence[Part], places: Places) -> Drawing:
    """All parts as one function of their signals in a row."""
    needed = [
        (part.user, name, size)
        for part in parts
        for name, size in zip(part.needs, part.sizes, strict=True)
    ]
    largest = {(user, name): 0 for user, name, _ in needed}
    for user, name, size in needed:
        largest[user, name] = max(largest[user, name], size)
    symbols = {key: ca.SX.sym("_".join(key), size) for key, size in largest.items()}
    results = []
    for part in parts:
        given = zip(part.needs, part.sizes, strict=True)
        arguments = (symbols[part.user, name][:size] for name, size in given)
        results.append(ca.densify(ca.vec(part.function(*arguments))))
    raw, drawn = ca.vertcat(*symbols.values()), ca.vertcat(*results)
    order = [p for (user, name), n in largest.items() for p in places[user][name][:n]]
    return Drawing(ca.Function("picture", [raw], [drawn]), order)


def _lay_out(parts: Sequence[Part]) -> Iterator[dict[str, Any]]:
    """Where the results of the parts are among the numbers that are drawn."""
    offset = 0
    for part in parts:
        rows, columns = part.function.size_out(0)
        yield {
            "user": part.user, "gives": part.gives, "at": offset, "rows": rows, "columns": columns,
            "names": [*part.names], "sparse": part.sparse, "is_state": part.is_state,
        }  # fmt: skip
        offset += rows * columns


def _columns(program: Resolved, clock: str) -> list[str]:
    """The outputs in a row of a clock's table."""
    signals = program.simulation.signals
    span = signals.clock(clock)
    names = {
        signals.scalar(fmu.name, s.name): f"{fmu.name}.{s.name}"
        for fmu in program.system.fmus
        for s in fmu.description.outputs
    }
    return [names[place] for place in range(span.start, span.stop)]
