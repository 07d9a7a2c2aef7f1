"""Steps of several instances of a native FMU at once, beside the steps of each alone."""

from __future__ import annotations

import ctypes
import zipfile
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus import cache
from hapticlink.fmus.blocks import component
from hapticlink.fmus.build_fmu import build_native
from hapticlink.fmus.check import initialize, session
from hapticlink.fmus.native import lane_library
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import blocks
from tests.fmus import sample_components
from tests.fmus.test_native_fmu_entries import OTHERS, H

ENCODERS = ("sensing=encoders", "controller.bias=full", "mechanism.directions=true")
LANES, STEPS = lane_library.LANES, 12
OF_ONE = (
    ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh,
    ca.acosh, ca.atanh, ca.exp, ca.expm1, ca.log, ca.log1p, ca.sqrt, ca.floor, ca.ceil, ca.fabs,
    ca.sign, ca.erf,
)  # fmt: skip
OF_TWO = (
    ca.atan2, ca.fmod, ca.remainder, ca.copysign, ca.fmin, ca.fmax, ca.hypot, ca.power,
)  # fmt: skip


def operations() -> Component:
    """All operations that CasADi has for scalars, on numbers of both signs, zeros and beyond their
    domains, in a state that keeps the finite ones."""
    b = Block(
        inputs=[Variable("u", (2,))],
        parameters=[Variable("p")],
        states=[Variable("x")],
        outputs=[Variable("y", (43,)), Variable("seen")],
    )
    one, two = b.u["u"][0], b.u["u"][1]
    values = [f(one) for f in OF_ONE] + [f(one, two) for f in OF_TWO]
    values += [one < two, one <= two, one == two, one != two, ca.logic_not(one > two)]
    values += [ca.logic_and(one > 0, two > 0), ca.logic_or(one > 0, two > 0)]
    values += [
        ca.if_else(one > two, ca.log(one), two / one),
        -one,
        one / two,
        one**2,
        2 * two,
        1 / one,
    ]
    kept = [ca.if_else(ca.logic_and(v > -9.0, v < 9.0), v, 0.0) for v in values]
    return b.component(
        "operations",
        "all operations",
        "sampled",
        initial={"x": b.p["p"]},
        step={"x": 0.5 * b.x["x"] + b.h * ca.sum1(ca.vertcat(*kept)) + b.p["p"] * b.t},
        output={"y": ca.vertcat(*kept), "seen": b.x["x"]},
    )


SAMPLES = {c.name: c for c in sample_components.EVERY}
SCENE = ("hand", "controller", "haptic_device", "virtual_mechanism", "virtual_environment")
NAMES = ("operations", *SAMPLES, *SCENE, "rubbing", "swung", "passive")


def made(name: str) -> Component:
    if name in SCENE:
        planned = {
            b.name: b for b in blocks.blocks(open_scene.load("closed-loop-ideal", ENCODERS)).built
        }
        return component(planned[name].block, planned[name].settings)
    return (
        operations()
        if name == "operations"
        else SAMPLES[name]
        if name in SAMPLES
        else OTHERS[name]()
    )


@pytest.mark.parametrize("name", NAMES)
def test_steps_at_once_have_the_bits_of_single_steps(name: str, tmp_path: Path) -> None:
    """Inputs and gains differ between the instances, of which one reads its outputs at
    seldom; what a step needs besides is left to the instance alone. Now and then a lane is empty,
    a gain is set, or a state is put back."""
    path = build_native(made(name), tmp_path)
    assert lane_library.compile_steps(path, tmp_path / "lanes.so")
    together = lane_library.load_steps(tmp_path / "lanes.so")
    draw = np.random.default_rng(1)
    with session(path) as at:
        slaves = [[at.instance() for _ in range(LANES)] for _ in range(2)]
        inputs = [v.valueReference for v in at.inputs]
        starts = np.array([float(v.start) for v in at.inputs])
        every = at.description.modelVariables
        parameters = [v for v in every if v.variability == "tunable" and v.causality == "parameter"]
        for each in slaves:
            for i, slave in enumerate(each):
                for p in parameters:
                    slave.setReal([p.valueReference], [float(p.start) * (1 + 1e-3 * i)])
                initialize(slave)
        counts = []
        for k in range(STEPS):
            spread = 2.0 if name == "operations" else 0.01
            given = starts + np.round(
                spread * draw.standard_normal((LANES, len(starts))), 1 + 2 * (spread < 1)
            )
            n, taken = LANES - k % 3, (ctypes.c_int64 * LANES)()
            for each in slaves:
                for slave, values in zip(each, given, strict=True):
                    if inputs:
                        slave.setReal(inputs, values)
                if parameters and k % 5 == 4:
                    each[k % LANES].setReal([parameters[-1].valueReference], [0.1 * k])
                if k % 7 == 3:
                    state = each[k % LANES].getFMUState()
                    each[k % LANES].doStep(k * H, H / 2)
                    each[k % LANES].setFMUState(state)
            lanes = [slave.component for slave in slaves[1]]
            if k % 11 == 7:
                lanes[k % LANES] = None
            together((ctypes.c_void_p * LANES)(*lanes), n, k * H, H, taken)
            assert lanes[k % LANES] or not taken[k % LANES]
            counts.append(sum(taken[:n]))
            for i, (alone, beside) in enumerate(zip(*slaves, strict=True)):
                alone.doStep(k * H, H)
                if not (i < n and taken[i]):
                    beside.doStep(k * H, H)
                if k % (1 + i):
                    continue
                np.testing.assert_array_equal(beside.getReal(at.reals), alone.getReal(at.reals))
        for alone, beside in zip(*slaves, strict=True):
            np.testing.assert_array_equal(beside.getReal(at.reals), alone.getReal(at.reals))
            states = [slave.serializeFMUState(slave.getFMUState()) for slave in (alone, beside)]
            assert states[0] == states[1]
    assert max(counts) == LANES


def test_what_vectors_do_not_take_is_stepped_one_by_one(tmp_path: Path, monkeypatch) -> None:
    """Look-ups of a table; an FMU of the Python kind; one that is not in the cache; no compiler."""
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    table, plain = (
        build_native(OTHERS["arm"](), tmp_path / "a"),
        build_native(SAMPLES["gain"], tmp_path / "b"),
    )
    assert lane_library.step_of_lanes(table, True) is None
    assert lane_library.step_of_lanes(plain, False) is None
    with monkeypatch.context() as patch:
        patch.setattr(lane_library, "OPTIONS", ("-no-such-option",))
        lane_library._find.cache_clear()
        assert lane_library.step_of_lanes(plain, True) is None
    lane_library._find.cache_clear()
    assert lane_library.step_of_lanes(plain, True) is not None
    assert lane_library.step_of_lanes(plain, False) is not None
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    lane_library._find.cache_clear()
    assert lane_library.step_of_lanes(plain, True) is None
    with zipfile.ZipFile(plain) as archive:
        assert {*lane_library.NEEDED} <= {
            name.removeprefix("sources/") for name in archive.namelist()
        }
    assert cache.folder() is None
