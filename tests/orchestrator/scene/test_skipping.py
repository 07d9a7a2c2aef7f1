"""What a scene does not need is left out, and leaving it out changes no result."""

from pathlib import Path

import numpy as np

from hapticlink.components.specs.contacts import Contacts
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.read_results import Table
from hapticlink.orchestrator.scene.blocks import FromGraphics, blocks

SHORT = "duration=0.2"


def haptics(scene: str, folder: Path, *options: str) -> Table:
    done = simulate(scene, folder, [SHORT, *options])
    assert done.outcome.fault is None
    return done.results.haptics


def same(one: Table, other: Table, tolerance: float = 0.0) -> None:
    common = [c for c in one.columns if c in other.columns]
    assert "virtual_mechanism.x[1]" in common
    for column in common:
        np.testing.assert_allclose(
            one[column], other[column], rtol=tolerance, atol=tolerance, err_msg=column
        )


def test_a_graphics_block_that_nothing_depends_on_changes_no_bit(tmp_path, monkeypatch):
    options = ("controller.topology=false", "controller.impedance=false")
    without = haptics("closed-loop-ideal", tmp_path / "without", *options)
    assert "graphics" not in {
        b.rate for b in blocks(open_scene.load("closed-loop-ideal", options)).built
    }
    monkeypatch.setattr(FromGraphics, "names", ["to look at"])
    shown = simulate("closed-loop-ideal", tmp_path / "with", [SHORT, *options])
    assert "virtual_environment.x[1]" in shown.results.graphics.columns
    same(without, shown.results.haptics)


def test_directions_without_a_topology_controller_change_no_bit(tmp_path):
    off = "controller.topology=false"
    without = haptics("closed-loop-ideal", tmp_path / "without", off)
    shown = haptics("closed-loop-ideal", tmp_path / "with", off, "mechanism.directions=true")
    assert "virtual_mechanism.P_c[1,1]" in shown.columns
    assert "virtual_mechanism.P_c[1,1]" not in without.columns
    same(without, shown)


def test_bodies_out_of_reach_change_nothing(tmp_path, monkeypatch):
    near = haptics("obstacles", tmp_path / "near")
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    monkeypatch.setattr(Contacts, "broad_phase", False)
    every = haptics("obstacles", tmp_path / "every")
    same(near, every, 1e-13)


def test_terms_that_are_zero_change_nothing(tmp_path):
    without = haptics("five-bar", tmp_path / "without")
    zero = ("linkage.gravity=[0.0, 0.0]", "linkage.joint.elbow1.friction=0.0")
    same(without, haptics("five-bar", tmp_path / "zero", *zero), 1e-13)
