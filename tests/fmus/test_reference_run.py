"""The reference run on the page of a block is what its FMU does."""

import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest

from hapticlink.fmus.build_fmu import build
from hapticlink.fmus.documentation import documentation
from hapticlink.fmus.reference_run import reference_run
from tests.fmus.sample_components import controller, fragile, spring, stateless

STEP = 1 / 64


@pytest.mark.parametrize("component", [spring(), spring(substeps=3), controller()])
def test_it_is_what_fmpy_finds_from_the_same_inputs(component, tmp_path):
    run = reference_run(component, STEP)
    assert run.moved
    assert run.duration == 0.5
    fmu = build(component, tmp_path)
    # FMPy sets the inputs of t_k before the step from t_k.
    inputs = np.rec.fromarrays([run.times, *run.moved.values()], names=["time", *run.moved])
    found = fmpy.simulate_fmu(
        str(fmu), stop_time=0.5, output_interval=STEP, input=inputs, output=list(run.answers)
    )
    # After a step a sampled block still has y(t_k), and FMPy's first row is that of the start.
    for name, values in run.answers.items():
        assert values == pytest.approx(found[name][1:], rel=1e-12, abs=1e-15), name


def test_inputs_without_a_hand_s_unit_stay(tmp_path):
    run = reference_run(fragile(), STEP)
    assert not run.moved
    assert set(run.answers) == {"y[1]", "y[2]", "count"}
    assert "no input moves it" in documentation(fragile(), run).decode()


def test_outputs_are_drawn_where_none_moves():
    page = documentation(stateless(), reference_run(stateless(), STEP)).decode()
    assert page.count('class="output"') == 1


def test_it_ends_before_a_value_that_is_not_finite():
    failing = fragile()
    run = reference_run(replace(failing, inputs=(replace(failing.inputs[0], start=2.5),)), STEP)
    assert 0 < len(run.times) < 32
    assert all(len(v) == len(run.times) and np.isfinite(v).all() for v in run.answers.values())


def test_it_takes_no_more_steps_at_a_high_rate():
    run = reference_run(spring(), 1e-4)
    assert len(run.times) == 256
    assert run.duration == pytest.approx(0.0256)


def test_the_page_has_both_drawings(tmp_path):
    fmu: Path = build(spring(), tmp_path)
    page = zipfile.ZipFile(fmu).read("documentation/index.html").decode()
    assert page.count("<svg") == 2
    assert "x [2] m, m/s" in page
    assert page.count('class="input"') == 1  # F
    assert page.count('class="output"') == 4  # x[1], x[2], a, time
