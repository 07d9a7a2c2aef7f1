"""OspSystemStructure.xml: simulators, connections and functions as libcosim steps them, against the
values that its fixed-step algorithm has by its definition: all outputs are got, all inputs set, all
simulators stepped."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from tests.little_fmus import python_fmu

TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
  <EndTime>0.5</EndTime>
  <BaseStepSize>0.01</BaseStepSize>
  <Algorithm>fixedStep</Algorithm>
  <Simulators>
    <Simulator name="gives" source="Gives.fmu" stepSize="0.021"/>
    <Simulator name="takes" source="Takes.fmu">
      <InitialValues>
        <InitialValue variable="gain"><Real value="3.0"/></InitialValue>
        <InitialValue variable="on"><Boolean value="true"/></InitialValue>
      </InitialValues>
    </Simulator>
    <Simulator name="also" source="Takes.fmu"/>
  </Simulators>
  <Functions><LinearTransformation name="scaled" factor="-2" offset="0.5"/></Functions>
  <Connections>
    <VariableConnection>
      <Variable simulator="takes" name="u"/>
      <Variable simulator="gives" name="y"/>
    </VariableConnection>
    <SignalConnection>
      <Variable simulator="gives" name="y"/><Signal function="scaled" name="in"/>
    </SignalConnection>
    <SignalConnection>
      <Signal function="scaled" name="out"/><Variable simulator="also" name="u"/>
    </SignalConnection>
  </Connections>
</OspSystemStructure>
"""


@pytest.fixture
def structure(tmp_path):
    python_fmu(tmp_path, "Gives")  # y is the time at the end of its step
    python_fmu(tmp_path, "Takes", "self.y = self.gain * self.u + 10 * self.on")

    def write(**changes):
        text = TEXT
        for old, new in changes.values():
            assert old in text
            text = text.replace(old, new)
        (path := tmp_path / "OspSystemStructure.xml").write_text(text)
        return path

    return write


def test_it_runs_as_its_master_steps_it(structure):
    found = hl.run(structure())
    assert found.fault is None
    steps = np.arange(51)
    np.testing.assert_array_equal(found.haptics["time"], steps / 100)
    # A step of 0.021 s is two of the base; takes steps with what gives had at its beginning.
    known = np.where(steps > 0, (steps - 1) // 2 * 2 / 100, 0.0)
    taken = np.where(steps > 0, 3.0 * known + 10.0, 0.0)
    np.testing.assert_allclose(found.haptics["takes.y"], taken, rtol=0, atol=1e-12)
    scaled = np.where(steps > 0, -2.0 * known + 0.5, 0.0)
    np.testing.assert_allclose(found.haptics["also.y"], scaled, rtol=0, atol=1e-12)


def test_what_is_read_otherwise_is_told(structure, caplog):
    assert hl.run(structure(change=("fixedStep", "ecco"))).fault is None
    assert "Algorithm = ecco: steps are fixed here, of BaseStepSize" in caplog.text


def test_it_begins_at_its_start_time(structure):
    found = hl.run(structure(change=("<EndTime>", "<StartTime>0.1</StartTime><EndTime>")))
    np.testing.assert_array_equal(found.haptics["time"], np.arange(10, 51) / 100)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("<EndTime>0.5</EndTime>", "", "duration: given neither by it"),
        ('source="Gives.fmu"', 'source="proxyfmu://localhost?file=Gives.fmu"', "on another comp"),
        ("LinearTransformation", "Sum", "function scaled: Sum has no counterpart"),
        ('name="gives" s', 'name="other" s', "there is no simulator 'gives'"),
        ('"takes" name="u"', '"also" name="y"', "one of the two has to be an output"),
        ("<BaseStepSize>0.01", "<BaseStepSize>x", "BaseStepSize = x: write a number"),
        ("<BaseStepSize>0.01", "<BaseStepSize>0", "BaseStepSize = 0: write a number above 0"),
        ('Real value="3.0"', 'Real value="abc"', "takes.gain = abc: no Real"),
        ('Boolean value="true"', 'Boolean value="yes"', "takes.on = yes: no Boolean"),
        ('Real value="3.0"', 'Float value="3.0"', "takes.gain: Float is none of Real, Integer"),
        ('factor="-2"', 'factor="two"', "function scaled: factor = two: write a number"),
        ('<Variable simulator="gives" name="y"/><Sig', "<Sig", "SignalConnection: it has 1 ends"),
        ("VariableConnection", "VariableGroupConnection", "write a VariableConnection for each"),
        ("OspSystemStructure ", "Other ", "not well-formed XML"),
        ("<Osp", "<!DOCTYPE a>\n<Osp", "declares a document type, which may expand"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused(structure, old, new, why):
    with pytest.raises(InputFault) as refused:
        hl.run(structure(change=(old, new)))
    assert why in str(refused.value)
