"""A step and its outputs in one pass: the same bits as the component's own functions, with fewer
operations."""

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.component import Block, Variable
from hapticlink.fmus.blocks import component
from hapticlink.fmus.fmu_functions import one_pass
from hapticlink.orchestrator.open_scene import load
from hapticlink.orchestrator.scene.blocks import blocks
from tests.blocks import once
from tests.fmus import sample_components

PULLED = ("closed-loop-ideal", "graphics.sync=operational")
SCENES = (("closed-loop-ideal",), PULLED, ("local-model",), ("obstacles",), ("virtual-wall",))


@once
def planned(scene, *options):
    return {block.name: block for block in blocks(load(scene, options)).built}


@once
def made(scene, name):
    """The component of a block of a scene, its name and options."""
    block = planned(*scene)[name]
    return component(block.block, block.settings)


EVERY = [(scene, name) for scene in SCENES for name in planned(*scene)]
EVERY += [(None, c.name) for c in sample_components.EVERY]
SAMPLES = {c.name: c for c in sample_components.EVERY}


def column(values):
    return np.asarray(values, dtype=float).ravel()


@pytest.mark.parametrize(("scene", "name"), EVERY)
def test_one_pass_gives_the_bits_of_step_and_output(scene, name):
    """Two steps in turn, of inputs that differ between them, and what the first hands on."""
    block = made(scene, name) if scene else SAMPLES[name]
    parts, draw = one_pass(block), np.random.default_rng(1)
    p = np.array(block.start_parameters)
    u = [np.array(block.start_inputs) + 1e-3 * draw.standard_normal(len(block.start_inputs))
         for _ in range(2)]  # fmt: skip
    x, t, h = column(block.initialize(u[0], p)), 0.3, 0.002
    x = x + 1e-4 * draw.standard_normal(x.size)
    z = parts.output(x, u[0], p, t)[1]
    for k in range(2):
        end = t + h
        got = [column(part) for part in parts.advance(x, u[k], p, t, h, end, z)]
        after = column(block.step(x, u[k], p, t, h))
        at = (x, u[k], p, t) if block.timing == "sampled" else (after, u[k], p, end)
        np.testing.assert_array_equal(got[0], after)
        np.testing.assert_array_equal(got[1], column(block.output(*at)))
        np.testing.assert_array_equal(got[2], column(parts.output(after, u[k], p, end)[1]))
        x, t, z = got[0], end, got[2]


def test_nothing_is_simplified_across_the_two():
    """(u + x) - u is not x, and 1 + (1e20 - 1e20) is not (1 + 1e20) - 1e20."""
    block = Block(
        inputs=[Variable("u")], states=[Variable("x")], outputs=[Variable("y"), Variable("z")]
    )
    x, u = block.x["x"], block.u["u"]
    made = block.component(
        "c", "", "continuous",
        initial={"x": ca.SX(1)}, step={"x": u + x}, output={"y": x - u, "z": 1 / x},
    )  # fmt: skip
    parts = one_pass(made)
    _, y, _ = parts.advance(1.0, 1e20, ca.DM(0, 1), 0.0, 1.0, 1.0, [])
    assert column(y).tolist() == [0.0, 1e-20]


@pytest.mark.parametrize(
    ("scene", "name", "share"),
    [
        (("closed-loop-ideal",), "virtual_mechanism", 0.88),
        (("closed-loop-ideal",), "haptic_device", 0.75),
        (("closed-loop-ideal",), "virtual_environment", 0.65),
        (("closed-loop-direct",), "virtual_mechanism", 0.75),
    ],
)
def test_operations_saved(scene, name, share):
    """Loads and stores of the values that are handed on do not count as operations."""
    block = made(scene, name)
    parts = one_pass(block)
    apart = block.step.n_instructions() + block.output.n_instructions()
    assert parts.advance.n_instructions() - 2 * parts.n_shared < share * apart


def test_exact_copy_takes_a_fifteenth_of_the_operations_of_a_pulled_one():
    """20 substeps of 1,679 operations, with outputs after the last, against 2,321."""

    def operations(*scene):
        parts = one_pass(made(scene, "virtual_environment"))
        before = (parts.substeps - 1) * parts.substep.n_instructions()
        return before + parts.advance.n_instructions()

    assert 15 * operations("closed-loop-ideal") < operations(*PULLED)


def test_a_pulled_copy_counts_its_constrained_directions_once_a_frame():
    """The substeps before the last move it; the count is of eigenvalues of Lambda^-1."""
    block = made(PULLED, "virtual_environment")
    assert block.substep.n_instructions() < 0.6 * block.step.n_instructions()
    arguments = block.substep.sx_in()
    after, before = block.substep(*arguments)[-1], arguments[0][-1]
    assert ca.is_equal(after, before)
