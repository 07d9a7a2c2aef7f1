"""Connections to parameters: tunable ones act at each communication point, fixed ones once."""

import numpy as np
import pytest
from scipy.linalg import expm

from hapticlink.orchestrator.experiment import simulate
from tests.orchestrator.foreign_fmus import PAIR, edited, python_fmu, scene

GAIN = PAIR.replace("takes.u", "takes.gain")


@pytest.fixture
def fmus(tmp_path):
    python_fmu(tmp_path, "Gives", "self.y = 100.0 + 400.0 * (time + size)")
    python_fmu(tmp_path, "Takes", "self.y = self.gain")
    return tmp_path


def test_a_tunable_parameter_is_set_at_each_communication_point(fmus):
    results = simulate(str(scene(fmus, GAIN)), fmus / "out").results
    given = results.haptics["gives.y"]
    np.testing.assert_array_equal(results.haptics["takes.y"][1:], given[:-1])
    assert given[-1] == 100.0 + 400.0 * 0.5
    assert results.run["delays"]["gives.y -> takes.gain"]["max"] == 0.0


def test_a_fixed_parameter_is_set_once(fmus):
    edited(fmus / "Takes.fmu", lambda text: text.replace('"tunable"', '"fixed"'))
    results = simulate(str(scene(fmus, GAIN)), fmus / "out").results
    np.testing.assert_array_equal(results.haptics["takes.y"], 0.0)


MASS = """
linkage.operational_point.body = "mass"
linkage.body = [{ name = "mass", mass = 2.0, inertia = 1.0 }]
linkage.joint = [
    { name = "slide", type = "prismatic", child = "mass", axis = 0.0, stiffness = 1.0 },
]
linkage.start = { slide = 0.3 }
connection = [{ from = "gives.y", to = "virtual_mechanism.slide.stiffness" }]
fmu = [{ name = "gives", path = "Gives.fmu", rate = "haptics" }]
"""


@pytest.mark.parametrize("packaging", ["python", "native"])
def test_a_spring_that_stiffens_in_steps(fmus, packaging):
    """m x'' = -k(t_k) x over each step, in closed form."""
    path = scene(fmus, f'packaging = "{packaging}"' + MASS, rate=512)
    table = simulate(str(path), fmus / "out").results.haptics
    state, found = np.array([0.3, 0.0]), []
    for k in table["gives.y"]:
        found.append(state[0])
        state = expm(np.array([[0.0, 1.0], [-k / 2.0, 0.0]]) / 512) @ state
    np.testing.assert_allclose(table["virtual_mechanism.q[1]"], found, atol=1e-8)
