"""docs/ports.md lists every port of the project's blocks, with the unit that its FMU declares."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import hapticlink as hl
from hapticlink.components.component import Variable
from hapticlink.fmus.blocks import component
from hapticlink.orchestrator.scene.blocks import blocks
from tests.blocks import once
from tests.docs.pages import ROOT

MADE = once(component)

WALL = {
    "name": "wall",
    "block": "virtual_wall",
    "settings": {"stiffness": 1.0, "damping": 1.0, "velocity": "measured", "passivity": 1.0},
}
SCENES: list[tuple[str, Mapping[str, Any]]] = [
    (
        "closed-loop-ideal",
        {"sensing": "encoders", "controller.bias": "full", "controller.passivity": True},
    ),
    ("closed-loop-ideal", {"mechanism.directions": True, "mechanism.diagnostics": True}),
    ("closed-loop", {"device.observer.beside": True}),
    ("closed-loop-ideal", {"mechanism.integrator": "passive-midpoint"}),
    ("closed-loop-ideal", {"graphics.sync": "operational", "hand.damping": (1.0, 1.0, 0.1)}),
    ("enclosure", {"controller.contact": True}),
    ("local-model", {}),
    ("two-hands", {"mechanism.directions": True}),
    ("two-users", {"mechanism.directions": True}),
    ("two-hands", {"fmu": [WALL], "connection": [{"from": "hand.F", "to": "wall.v"}]}),
    (
        "closed-loop-ideal",
        {
            "linkage.points": {n: {"body": "link2"} for n in "ab"},
            "linkage.operational_point": "a",
        },
    ),
    ("two-hands", {"linkage.joint.0.ports": ("effort", "position", "velocity")}),
]
"""Scenes that have every port among them; n = 4 joint coordinates and one loop, m = 2, in each."""
SIZES = {4: "n", 2: "m", 12: "k"}
OF_DEVICE = ("haptic_device", "observer", "motor_map")
"""Blocks whose sizes are those of the device: four motors."""
Row = tuple[str, str, str, str]
"""Block, "input" or "output", port with its sizes, and units."""


def declared() -> Iterator[Row]:
    for name, options in SCENES:
        scene = hl.scene(name, options)
        for block in blocks(scene).built:
            made = MADE(block.block, block.settings)
            for side, variables in (("input", made.inputs), ("output", made.outputs)):
                yield from ((block.block, side, port(v, block.block), units(v)) for v in variables)


def port(variable: Variable, block: str) -> str:
    known = {} if block in OF_DEVICE else SIZES
    sizes = ",".join(known.get(size, str(size)) for size in variable.shape)
    name = re.sub(r"^shoulder1\.(?!at)", "JOINT.", re.sub(r"^left\.", "POINT.", variable.name))
    return name + f"[{sizes}]" * bool(sizes)


def units(variable: Variable) -> str:
    return ", ".join(dict.fromkeys(variable.units))


def listed() -> Iterator[Row]:
    block = side = ""
    for line in (ROOT / "docs" / "ports.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("## "):
            block = line[3:]
        elif cells[0] in ("input", "output"):
            side = cells[0]
        elif line.startswith("| `"):
            assert len(cells) == 4, line
            assert cells[3], line
            yield block, side, cells[0].strip("`"), cells[1]


def test_the_page_lists_every_port_and_no_other() -> None:
    assert sorted(listed()) == sorted(set(declared()))
