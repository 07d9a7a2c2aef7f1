"""What modelDescription.xml says of a component, read back by FMPy."""

from __future__ import annotations

import io
from xml.etree import ElementTree as ET

import fmpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.port_space import PLANE
from hapticlink.fmus.description_common import describe_component as of_component
from hapticlink.fmus.errors import InvalidUnit
from hapticlink.fmus.model_description import files
from hapticlink.fmus.scalar_variables import find_feed_through, initial_dependencies
from hapticlink.fmus.units import BASES, base_unit
from tests.fmus import sample_components

N = {"kg": 1, "m": 1, "s": -2}


def read(path):
    return fmpy.read_model_description(str(path))


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("1", {}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("1/(kg.m2)", {"kg": -1, "m": -2}),
        ("m/s2", {"m": 1, "s": -2}),
        ("rad/s", {"s": -1, "rad": 1}),
        ("N.m.s/rad", {"kg": 1, "m": 2, "s": -1, "rad": -1}),
        ("N/N", {}),
        ("N.s/m", {"kg": 1, "s": -1}),
        ("N2.Hz", {"kg": 2, "m": 2, "s": -5}),
        ("s-2", {"s": -2}),
    ],
)
def test_units(unit, exponents):
    assert base_unit(unit) == exponents


def test_units_of_the_contract_are_known():
    force_over_acceleration = {"kg": 1}
    assert [base_unit(u) for u in PLANE.wrench.units] == [N, N, {**N, "m": 2}]
    assert base_unit(PLANE.inertia.units[0]) == force_over_acceleration
    for heavy, light in zip(PLANE.inertia.units, PLANE.mobility.units, strict=True):
        assert base_unit(light) == {base: -power for base, power in base_unit(heavy).items()}


@pytest.mark.parametrize("unit", ["", "furlong", "m//s", "m/s/s", "N m", "1/kg.m2", "m^2", "kg)"])
def test_what_is_no_unit_is_refused(unit):
    with pytest.raises(InvalidUnit, match="unit"):
        base_unit(unit)


@given(st.dictionaries(st.sampled_from(BASES), st.integers(-4, 4).filter(bool), min_size=1))
def test_products_of_powers_come_back(exponents):
    assert base_unit(".".join(f"{base}{power}" for base, power in exponents.items())) == exponents


def test_variables(fmus):
    described = {v.name: v for v in read(fmus["spring"]).modelVariables}
    assert list(described) == ["F", "m", "k", "x[1]", "x[2]", "a", "time"]
    assert [v.valueReference for v in described.values()] == list(range(7))
    found = [(v.causality, v.variability, v.initial) for v in described.values()]
    assert found[:4] == [
        ("input", "continuous", "exact"),  # FMPy's default for an input; the file says none
        ("parameter", "fixed", "exact"),
        ("parameter", "tunable", "exact"),
        ("output", "continuous", "calculated"),
    ]
    assert described["k"].start == "8.0"
    assert described["x[2]"].unit == "m/s"
    assert described["x[1]"].description == "position & velocity"


def test_matrices_row_by_row(fmus):
    starts = {v.name: v.start for v in read(fmus["controller"]).modelVariables if v.start}
    names = ["G[1,1]", "G[1,2]", "G[2,1]", "G[2,2]"]
    assert [starts[name] for name in names] == ["1.0", "2.0", "3.0", "4.0"]


def test_outputs_of_a_sampled_block_are_discrete(fmus):
    for v in read(fmus["controller"]).modelVariables:
        assert v.variability == ("discrete" if v.causality == "output" else "continuous")


def test_dependencies():
    spring, controller = sample_components.spring(), sample_components.controller()
    assert find_feed_through(spring) == [[], [], [0], []]
    # x0 = F/k + 1 brings F and k into x[1]; a = (F - k x0)/m = -k/m loses F for good only
    # numerically: the structure keeps it.
    assert initial_dependencies(spring) == [[0, 2], [], [0, 1, 2], []]
    assert find_feed_through(controller) == [[0, 1, 2, 3], [0, 1, 4, 5], [], []]


def test_model_structure(fmus):
    described = read(fmus["spring"])
    assert [(u.variable.name, [v.name for v in u.dependencies]) for u in described.outputs] == [
        ("x[1]", []),
        ("x[2]", []),
        ("a", ["F"]),
        ("time", []),
    ]
    initial = {u.variable.name: [v.name for v in u.dependencies] for u in described.initialUnknowns}
    assert initial == {"x[1]": ["F", "k"], "x[2]": [], "a": ["F", "m", "k"], "time": []}


def test_capabilities_experiment_and_authors(fmus):
    described = read(fmus["spring"])
    kind = described.coSimulation
    assert kind.canGetAndSetFMUstate
    assert kind.canSerializeFMUstate
    assert kind.canHandleVariableCommunicationStepSize
    assert not kind.canInterpolateInputs
    assert kind.needsExecutionTool
    assert described.defaultExperiment.stepSize == repr(1 / 512)
    assert (described.author, described.license) == ("The hapticlink authors", "MIT")
    assert described.generationTool == f"hapticlink {described.version}"
    assert described.generationDateAndTime is None


def test_timing_and_substeps_for_our_own_tools():
    about = of_component(sample_components.spring(substeps=3), stop_time=1.0, step_size=0.1)
    text = files(about, "{x}")["modelDescription.xml"]
    block = ET.parse(io.BytesIO(text)).find("VendorAnnotations/Tool[@name='hapticlink']/Block")
    assert block is not None
    assert block.attrib == {"timing": "continuous", "substeps": "3"}
