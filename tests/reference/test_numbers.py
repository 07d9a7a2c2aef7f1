"""The five-bar of Table 6.1 at rest, read out of the built FMUs through FMPy.

Expected values: Pinocchio (constraintDynamics) on the assembled pose, agreeing with the
corrected equations to 1e-14.
"""

import numpy as np
import pytest

from hapticlink.fmus.check import session
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system import fmu_files
from hapticlink.orchestrator.system.timeline import timeline
from tests.mechanisms import MOBILITY, WRENCH

Q = (0.784991951649258, -1.572795639643859, -1.25622704583455, 1.570109063323428)
QDD = (4.287604403298784, -8.025937758732525, -12.053370282343105, 13.642585235436435)
MULTIPLIERS = (0.201619247044097, 0.050598224334071)
EIGENVALUES = (0.0, 0.59269813383711, 522.142472656353)


@pytest.fixture(scope="module")
def at_rest(tmp_path_factory):
    """Outputs by name of the two FMUs in initialisation, the wrench set on the mechanism."""
    scene = open_scene.load("closed-loop-ideal", ["mechanism.directions=true"])
    files = fmu_files.fmu_files(
        scene, blocks(scene), timeline(scene), tmp_path_factory.mktemp("fmus")
    )
    found = {}
    for name in ("virtual_mechanism", "virtual_environment"):
        with session(files[name]) as opened:
            slave = opened.instance()
            variables = opened.description.modelVariables
            references = {v.name: v.valueReference for v in variables}
            slave.setupExperiment()
            slave.enterInitializationMode()
            if name == "virtual_mechanism":
                slave.setReal([references[f"F_hand[{i + 1}]"] for i in range(3)], WRENCH)
            values = dict(zip(references, slave.getReal(list(references.values())), strict=True))
        found[name] = values
    return found


def vector(values, name, n):
    return np.array([values[f"{name}[{i + 1}]"] for i in range(n)])


def matrix(values, name):
    return np.array([[values[f"{name}[{i + 1},{j + 1}]"] for j in range(3)] for i in range(3)])


def close(found, expected):
    """1e-10 of the largest entry."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("fmu", ["virtual_mechanism", "virtual_environment"])
def test_assembled_pose_and_mobility(at_rest, fmu):
    close(vector(at_rest[fmu], "q", 4), np.array(Q))
    mobility = matrix(at_rest[fmu], "Lambda_inv")
    close(mobility, MOBILITY)
    close(np.linalg.eigvalsh(mobility), np.array(EIGENVALUES))
    assert at_rest[fmu]["n_constraints"] == 1


def test_acceleration_and_multipliers(at_rest):
    values = at_rest["virtual_mechanism"]
    close(vector(values, "qdd", 4), np.array(QDD))
    close(vector(values, "lambda", 2), np.array(MULTIPLIERS))
    np.testing.assert_allclose(vector(values, "a_bias", 3), 0, atol=1e-12)
