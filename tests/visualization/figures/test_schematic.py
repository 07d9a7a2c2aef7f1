"""A schematic shows the parts that the blocks of its scene have, and no others."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.fmus.blocks import component
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization.figures import schematic

AS_STATED = {"graphics.sync": "operational"}
FULL = {"device.observer.law": "kalman", "controller.bias": "full", "device.motor.damping": 1.25e-5}
LOCAL = {**AS_STATED, "local_model": True, "mechanism.integrator": "semi-implicit-euler"}


@cache
def texts(scene: str, options: tuple[tuple[str, Any], ...] = ()) -> Mapping[str, str]:
    """All that each drawing of a scene says, by its name."""
    read = hl.scene(scene, dict(options))
    with build_system(read) as system:
        figures = schematic.figures(read, system)
    return {
        name: "\n".join(text.get_text() for text in figure.axes[0].texts)
        for name, figure in figures.items()
    }


CASES = [
    ("device", "closed-loop", {}, "encoders", "closed-loop-ideal", {}),
    ("device", "closed-loop", {}, "Nicosia observer", "closed-loop-ideal", {}),
    ("device", "closed-loop", FULL, "Kalman", "closed-loop", {}),
    ("device", "closed-loop-ideal", {}, "ideal sensing", "closed-loop", {}),
    ("device", "closed-loop", {}, "F_T", "closed-loop", {"controller.topology": False}),
    ("device", "closed-loop", FULL, "a_{bias}", "closed-loop", {}),
    ("simulation", "closed-loop", {}, "Baumgarte", "closed-loop-ideal", {}),
    ("inside-virtual-mechanism", "closed-loop", {}, "w_{stab}", "closed-loop-ideal", {}),
    ("inside-virtual-mechanism", "closed-loop-ideal", {}, "projection", "closed-loop", {}),
    ("simulation", "closed-loop", AS_STATED, "graphics controller (C)", "closed-loop", {}),
    ("simulation", "closed-loop", AS_STATED, "K_g", "closed-loop", {}),
    ("simulation", "closed-loop", {}, "projection", "closed-loop", AS_STATED),
    ("simulation", "closed-loop", LOCAL, "local model's matrices", "closed-loop", AS_STATED),
    ("simulation", "closed-loop", LOCAL, r"\widehat{D}", "closed-loop", AS_STATED),
]  # fmt: skip


@pytest.mark.parametrize(("drawing", "scene", "options", "part", "other", "without"), CASES)
def test_a_part_is_drawn_where_the_scene_has_it_and_not_elsewhere(
    drawing: str,
    scene: str,
    options: dict[str, Any],
    part: str,
    other: str,
    without: dict[str, Any],
) -> None:
    assert part in texts(scene, tuple(options.items()))[drawing]
    assert part not in texts(other, tuple(without.items()))[drawing]


def test_a_drawing_says_where_signals_come_from_and_how_they_are_held() -> None:
    said = texts("closed-loop")["device"]
    assert "from virtual_environment:\nLambda_inv, zoh" in said
    assert "(4.6), corrected" in said
    assert "k_j = 200 1/s2" in said


def test_no_line_is_wider_than_its_box() -> None:
    said = texts("closed-loop", tuple(FULL.items()))["device"]
    assert "motor_damping = 1.25e-05," in said
    lines = said[said.index("motor_damping") :].split("\n")
    assert max(len(line) for line in lines if "$" not in line) <= schematic.LETTERS


@cache
def _components(scene: str) -> dict[str, Component]:
    return {b.name: component(b.block, b.settings) for b in blocks(hl.scene(scene)).built}


def _reads_at_once(of: Component) -> dict[str, set[str]]:
    """By output, the inputs from which a path of the parts leads to it without a state."""
    states = {v.name for v in of.states}
    giver = {name: part for part in of.parts for name in part.gives}

    def behind(name: str, seen: frozenset[str]) -> set[str]:
        if name in seen or name in states:
            return set()
        part = giver.get(name)
        if part is None:
            return {name}
        return {found for read in part.reads for found in behind(read, seen | {name})}

    return {v.name: behind(v.name, frozenset()) for v in of.outputs}


def _depends_at_once(of: Component) -> dict[str, set[str]]:
    """By output, the inputs on which the equations let it depend."""
    pattern = np.array(of.output.jac_sparsity(0, 1)).astype(bool)
    rows = np.cumsum([0, *(v.size for v in of.outputs)])
    columns = np.cumsum([0, *(v.size for v in of.inputs)])
    return {
        y.name: {
            u.name
            for k, u in enumerate(of.inputs)
            if pattern[rows[i] : rows[i + 1], columns[k] : columns[k + 1]].any()
        }
        for i, y in enumerate(of.outputs)
    }


@pytest.mark.parametrize(
    "scene", ["closed-loop", "closed-loop-b1", "closed-loop-ideal", "two-users", "push-disc"]
)
def test_wires_lead_to_outputs_from_all_inputs_on_which_the_equations_depend(scene: str) -> None:
    for name, of in _components(scene).items():
        if of.parts:
            drawn = _reads_at_once(of)
            for output, inputs in _depends_at_once(of).items():
                assert inputs <= drawn[output], (name, output)


@pytest.mark.parametrize("scene", ["closed-loop", "closed-loop-b1", "closed-loop-ideal"])
def test_the_equations_depend_on_every_gain_of_a_part(scene: str) -> None:
    for name, of in _components(scene).items():
        at, used = 0, set()
        patterns = [np.array(f.jac_sparsity(0, 2)).astype(bool) for f in (of.step, of.output)]
        for v in of.parameters:
            if any(pattern[:, at : at + v.size].any() for pattern in patterns):
                used.add(v.name)
            at += v.size
        read = {r for part in of.parts for r in part.reads} & {v.name for v in of.parameters}
        unused = read - used
        fixed_at_start = {"encoder_resolution", "stop_reach", "rank_tolerance", "hysteresis"}
        assert unused <= fixed_at_start, (name, unused)  # these decide, and have no derivative


@pytest.mark.parametrize(
    ("parts", "fault"),
    [
        ((BlockPart("a", "", reads=("z",), gives=("y",)),), "`a` reads ['z']"),
        (
            (BlockPart("a", "", gives=("y",)), BlockPart("b", "", gives=("y",))),
            "['y'] are given twice",
        ),
        ((BlockPart("a", "", reads=("u",)),), "no part gives ['y']"),
    ],
)
def test_parts_that_do_not_fit_their_block_are_refused(
    parts: tuple[BlockPart, ...], fault: str
) -> None:
    block = Block(inputs=[Variable("u")], outputs=[Variable("y")])
    with pytest.raises(ValueError, match="part") as refused:
        block.component(
            "b", "", "sampled", initial={}, step={}, output={"y": ca.SX(1)}, parts=parts
        )
    assert fault in str(refused.value)
