"""Declarations of ports in the annotation: read back as written; malformed ones are refused."""

import re
from functools import partial

import casadi as ca
import pytest

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.ports import Gradient, Power, SpringPorts
from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.description import describe
from tests.little_fmus import edited, python_fmu

SPRING = SpringPorts("far", "x", stiffness="K", damping="B", set_velocity="rate")


def declaring(**replaced: Variable) -> Component:
    """A block with something declared of every sort."""
    outputs = {
        "x": Variable("x", (2,), ("m", "rad")),
        "v": Variable("v", (2,), ("m/s", "rad/s"), derivative_of="x"),
        "a": Variable("der(v[1])", (), "m/s2"),
        "P": Variable("P", (2, 2), kind="projector"),
        "rows": Variable("rows", (3, 2), kind="table"),
        "turned": Variable("turned", (2,), ("m", "rad"), kind="angle"),
        "G": Variable("G", (4, 2), gradient=Gradient("P", at="x", by="far")),
    } | replaced
    block = Block(
        inputs=[
            Variable("F", (2,), ("N", "N.m"), power=Power("x", sign=-1.0)),
            Variable("far", (2,), ("m", "rad")),
            Variable("rate", (2,), ("m/s", "rad/s")),
        ],
        parameters=[Variable(name, (2,), start=(3.0, 4.0)) for name in ("K", "B")],
        outputs=outputs.values(),
    )
    output = {v.name: ca.SX.zeros(*v.shape) for v in outputs.values()}
    return block.component(
        "declaring", "", "sampled", initial={}, step={}, output=output, springs=[SPRING]
    )


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return build(declaring(), tmp_path_factory.mktemp("declaring"))


@pytest.mark.parametrize("make", [build, build_native, partial(build_native, fmi=3)])
def test_what_a_component_declares_comes_back(tmp_path, make):
    found = describe(make(declaring(), tmp_path))
    assert found.timing == "sampled"
    assert found.kinds == {"P": "projector", "rows": "table", "turned": "angle"}
    assert found.power == {"F": Power("x", sign=-1.0)}
    assert found.springs == (SPRING,)
    assert found.derivatives == {"x[1]": "v[1]", "x[2]": "v[2]", "v[1]": "der(v[1])"}
    assert [s.name for s in found.derivative(found.port("x", "output")) or ()] == ["v[1]", "v[2]"]
    assert found.derivative(found.port("v", "output")) is None


def test_a_derivative_of_nothing_is_refused_at_build(tmp_path):
    wrong = declaring(v=Variable("v", (2,), derivative_of="F"))
    with pytest.raises(FmuError, match="`v` is declared the derivative of `F`, which is no output"):
        build(wrong, tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('timing="sampled"', 'timing="samples"', "no timing 'samples'; did you mean 'sampled'"),
        ('kind="projector"', 'kind="project"', "no kind 'project'; did you mean 'projector'"),
        ('kind="table"', 'kind="projector"', "6 entries, and a projector matrix is square"),
        ('"P" kind="projector"', '"P" kind="angle"', "P is in 1, which is no angle"),
        ('"P" kind', '"Q" kind', "there is no output 'Q'"),
        ('"P" kind', '"F" kind', "there is no output 'F'"),
        ('"F" displacement="x"', '"F" displacement="y"', "there is no output 'y'"),
        ('"F" displacement="x"', '"F" displacement="P"', "P has 4 entries, and 2 are needed"),
        ('"F" displacement="x"', '"x" displacement="x"', "there is no input 'x'"),
        ('sign="-1.0"', 'sign="0"', "F: sign 0 is neither 1 nor -1"),
        ('sign="-1.0"', 'sign="minus"', "could not convert string to float: 'minus'"),
        (' sign="-1.0"', ' sing="-1"', "no attribute 'sing'; did you mean 'sign'"),
        (' displacement="x"', "", "displacement is missing"),
        ('set_position="far"', 'set_position="x"', "there is no input 'x'"),
        ('stiffness="K"', 'stiffness="far"', "there is no parameter 'far'"),
        ('position="x"', 'position="P"', "P has 4 entries, and 2 are needed"),
        (' displacement="x"', ' units="m"', "F has 2 entries, and 1 units"),
        ('at="x" by', 'at="P" by', "P has 4 entries, and 2 are needed"),
        ('by="far"', 'by="x"', "there is no input 'x'"),
        ('of="P"', 'of="v"', "G has 8 entries, and 4 are needed"),
        ("<Spring", "<Sprung", "no element 'Sprung'; did you mean 'Spring'"),
    ],
)
def test_what_is_malformed_or_does_not_fit_is_told(fmu, tmp_path, old, new, why):
    changed = tmp_path / "declaring.fmu"
    changed.write_bytes(fmu.read_bytes())

    def change(text):
        assert text.count(old) == 1
        return text.replace(old, new)

    with pytest.raises(InputFault, match=re.escape(why)):
        describe(edited(changed, change))


def test_the_annotation_of_another_tool_says_nothing(tmp_path):
    other = '<VendorAnnotations><Tool name="other"><Block timing="?"><Port/></Block></Tool>'
    other += "</VendorAnnotations><ModelVariables>"
    path = python_fmu(tmp_path, "Other")
    found = describe(edited(path, lambda text: text.replace("<ModelVariables>", other)))
    assert (found.timing, found.kinds, found.power, found.springs) == ("continuous", {}, {}, ())


@pytest.mark.parametrize(("convention", "known"), [("structured", {"y": "der(y)"}), ("flat", {})])
def test_der_is_a_derivative_where_names_are_structured(tmp_path, convention, known):
    """FMI 2.0.5 section 2.2.9; the FMU's own derivative of y says nothing of the names."""

    def change(text):
        text, count = re.subn(r'(NamingConvention=)"\w+"', rf'\1"{convention}"', text)
        assert count == 1
        return text.replace('name="steps"', 'name="der(y)"')

    assert describe(edited(python_fmu(tmp_path, "Named"), change)).derivatives == known
