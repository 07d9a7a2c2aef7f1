"""Instances of one file of this project have one library in a run, and are independent; FMUs of
others have one each."""

from contextlib import ExitStack

import numpy as np
import pytest

from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.fmi.process_cache import describe_once
from tests.orchestrator import coupled
from tests.orchestrator.c_fmus import hostile_fmu


@pytest.fixture(scope="module", autouse=True)
def _fmus_stay_unpacked():
    """Here they do not: folders are counted."""


@pytest.mark.parametrize("make", [build, build_native])
def test_instances_of_our_file_share_a_folder_until_the_last_is_closed(
    tmp_path, own_temporary_folder, make
):
    """y = 2 u, and z the w of the step before."""
    description = describe_once(make(coupled.gain("gain", 2.0, 0.0), tmp_path))
    instances = [InProcess(f"f{i}", description, np.zeros(2)) for i in range(8)]
    with ExitStack() as stack:
        for instance in instances:
            stack.enter_context(instance)
        assert len([*own_temporary_folder.iterdir()]) == 1
        for i, instance in enumerate(instances):
            instance.enter_initialization(0.0, 1.0)
            instance.exit_initialization()
            scalars = [*description.port("u", "input"), *description.port("w", "input")]
            instance.connect(scalars, range(len(scalars)))(np.array([0.0, float(i)]))
        for instance in instances:  # all are set before one steps
            instance.step(0.0, 0.1, 0.1)
        for i, instance in enumerate(instances):
            instance.get()
            assert instance.outputs[1] == float(i)
        instances[0].close()
        assert len([*own_temporary_folder.iterdir()]) == 1
    assert not [*own_temporary_folder.iterdir()]


def test_instances_of_a_file_of_others_have_a_library_each(tmp_path, own_temporary_folder):
    description = describe(hostile_fmu(tmp_path))
    with ExitStack() as stack:
        for i in range(2):
            outputs = np.zeros(len(description.outputs))
            stack.enter_context(InProcess(f"f{i}", description, outputs))
        assert len([*own_temporary_folder.iterdir()]) == 2
    assert not [*own_temporary_folder.iterdir()]
