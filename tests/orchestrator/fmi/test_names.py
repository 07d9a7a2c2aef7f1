"""Names and value references of foreign FMUs: none shifts a column, none is another variable's."""

import pytest

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.fmi.description import describe
from tests.orchestrator.fmi.test_archives import fmu
from tests.orchestrator.foreign_fmus import DESCRIPTION, edited, fmu_table, python_fmu, run


@pytest.mark.parametrize("name", ["a,b", '"a", b', '"', '""', "'", ',",', "a b", "λ[1,2]"])
def test_any_name_comes_back_from_the_csv(tmp_path, name):
    xml = name.replace('"', "&quot;")
    path = python_fmu(tmp_path, "Gives", "self.y = 7.0")
    edited(path, lambda text: text.replace('name="y"', f'name="{xml}"'))
    _, results = run(tmp_path, fmu_table("gives", "Gives"))
    assert results.haptics.columns == ("time", f"gives.{name}", "gives.steps")
    assert results.haptics[f"gives.{name}"][-1] == 7.0
    assert results.haptics["gives.steps"][-1] == 32.0


@pytest.mark.parametrize("name", ["a&#10;b", "a&#13;", "a&#9;b", "a&#x202e;b"])
def test_names_that_are_no_line(tmp_path, name):
    text = DESCRIPTION.replace('name="y"', f'name="{name}"')
    with pytest.raises(InputFault, match="printable characters"):
        describe(fmu(tmp_path / "model.fmu", text))


@pytest.mark.parametrize("reference", [2**32, 2**32 + 1, -1, 2**64])
def test_value_references_are_of_32_bits(tmp_path, reference):
    text = DESCRIPTION.replace('valueReference="1"', f'valueReference="{reference}"')
    with pytest.raises(InputFault, match=f"'y': value reference {reference} is not from 0 to"):
        describe(fmu(tmp_path / "model.fmu", text))


def test_two_variables_of_one_name_are_refused(tmp_path):
    """They would be one column, and all columns after it those of their neighbours."""
    text = DESCRIPTION.replace('name="mode"', 'name="y"')
    with pytest.raises(InputFault, match="'y': 2 variables have this name"):
        describe(fmu(tmp_path / "model.fmu", text))
