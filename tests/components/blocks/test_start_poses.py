"""Blocks of one linkage whose start poses differ are one FMU with other start values, where
`has_free_start` and `StartPoses` say so."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest

from hapticlink.components.blocks.start_settings import has_free_start, start_pose
from hapticlink.components.component import Component
from hapticlink.components.dynamics.start_poses import StartPoses
from hapticlink.components.specs.linkage import Linkage, coordinates
from hapticlink.fmus.blocks import component
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.blocks import blocks
from tests.components.blocks.test_start_settings import content

SCENES = (
    "closed-loop",
    "closed-loop-ideal",
    "closed-loop-bricard",
    "serial",
    "two-users",
    "six-bar",
    "peaucellier",
)
HOLD = {"closed-loop": "hold=model"}


def _started(of: Component) -> dict[str, tuple[float, ...]]:
    return {v.name: v.starts for v in (*of.parameters, *of.inputs)}


def _moved(linkage: Linkage, seed: int) -> Linkage:
    """The linkage with another start pose, from which loops may close or not."""
    generator = np.random.default_rng(seed)
    start = {
        name: tuple((np.array(value) + generator.normal(0, 0.3 * seed, np.shape(value))).tolist())
        if np.ndim(value)
        else float(value + generator.normal(0, 0.3 * seed))
        for name, value in linkage.start.items()
    }
    return replace(linkage, start=start)


def _blocks(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    scene = open_scene.load(name, (HOLD[name],) if name in HOLD else ())
    for block in blocks(scene).built:
        if has_free_start(block.settings):
            yield block.block, block.settings


@pytest.mark.parametrize("scene", SCENES)
def test_start_poses_of_one_choice_are_start_values(scene: str) -> None:
    compared = 0
    for block, settings in _blocks(scene):
        linkage = settings["linkage"]
        poses, own = StartPoses(linkage), component(block, settings)
        for seed in (1, 5):  # near, where all close, and far
            moved = _moved(linkage, seed)
            choice = poses.choose(moved.start)
            if choice is None:
                with pytest.raises(FmuError, match="does not close"):
                    component("virtual_mechanism", {**_mechanism(scene), "linkage": moved})
            elif choice == poses.choose(linkage.start):
                other = component(block, {**settings, "linkage": moved})
                assert content(other, "inputs") == content(own, "inputs")
                set_to = start_pose(moved)
                assert _started(other) == {
                    name: set_to.get(name, value) for name, value in _started(own).items()
                }
                compared += 1
    assert compared


def _mechanism(scene: str) -> dict[str, Any]:
    return next(settings for block, settings in _blocks(scene) if block == "virtual_mechanism")


def test_poses_that_choose_other_coordinates_are_other_equations() -> None:
    settings = next(s for block, s in _blocks("closed-loop") if block == "virtual_environment")
    linkage = _mechanism("four-bar")["linkage"]
    poses = StartPoses(linkage)
    moved = [
        each for each in (_moved(linkage, seed) for seed in range(8)) if poses.choose(each.start)
    ]
    chosen = [poses.choose(each.start) for each in moved]
    made = [
        content(component("virtual_environment", {**settings, "linkage": each}), "inputs")
        for each in moved
    ]
    pairs = combinations_with_replacement(zip(chosen, made, strict=True), 2)
    same = [(a == b, one == other) for (a, one), (b, other) in pairs]
    assert {*same} == {(True, True), (False, False)}


@pytest.mark.parametrize("scene", ["n-four-bar", "geared-five-bar", "obstacles", "local-model"])
def test_what_follows_from_the_start_pose_is_in_the_equations(scene: str) -> None:
    """Start rates, contacts and the local model."""
    planned = blocks(open_scene.load(scene)).built
    assert not all(has_free_start(b.settings) for b in planned if "linkage" in b.settings)


def test_coordinates_that_a_scene_leaves_out_start_at_zero() -> None:
    linkage = replace(_mechanism("serial")["linkage"], start={})
    assert start_pose(linkage)["q_start"] == tuple(coordinates(linkage, {})) == (0.0, 0.0)
