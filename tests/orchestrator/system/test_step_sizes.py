"""FMUs are built for no step size: one for all rates, which a run tells its own."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.timeline import timeline
from tests.blocks import Running


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        ("slider-crank", ("mechanism.stabilization='baumgarte'",)),
        ("local-model", ("mechanism.stabilization='baumgarte'",)),
        ("virtual-wall", ()),
    ],
)
def test_every_rate_has_the_same_fmus(scene, options, tmp_path):
    def files(*rates):
        read = open_scene.load(scene, (*options, *rates))
        return fmu_files(read, blocks(read), timeline(read), tmp_path)

    graphics = ("graphics.rate=20",) if open_scene.load(scene).graphics else ()
    assert files("haptics.rate=500") == files("haptics.rate=1000", "duration=0.5", *graphics)


@pytest.mark.parametrize("rate", [400, 1000])
def test_friction_and_stabilization_take_the_step_of_the_run(rate):
    """As the component does that starts with that step."""
    options = {"haptics.rate": rate, "duration": 0.1, "mechanism.stabilization": "baumgarte"}
    scene = hl.scene("slider-crank", options)
    assert scene.linkage
    assert any(joint.friction for joint in scene.linkage.joint)
    run = hl.run(scene)
    own = Running(virtual_mechanism(scene.linkage, scene.mechanism, step_s=1 / rate))
    other = Running(virtual_mechanism(scene.linkage, scene.mechanism, step_s=1.5 / rate))
    for _ in range(rate // 10):
        own.step(1 / rate)
        other.step(1 / rate)
    found = run["virtual_mechanism.q"][-1]
    np.testing.assert_array_equal(found, own.state["q"])
    assert (found != other.state["q"]).any()
