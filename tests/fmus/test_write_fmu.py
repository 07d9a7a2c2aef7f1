"""An FMU is written if FMPy's validation passes it, by a shorter way where its names are plain."""

from __future__ import annotations

from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.python_fmu import entries
from hapticlink.fmus.write_fmu import findings, write_fmu
from tests.fmus import sample_components

DESCRIPTION = "modelDescription.xml"
VALID = ("x", "_a1", "x[1]", "a.b[2,3].c", "der(x)", "'a b'")
INVALID = ("1x", "x[]", "a..b", "x y", "é", "x[a]")


def renamed(name: str) -> dict[str, bytes]:
    """The entries of an FMU, one of whose variables has the name."""
    files = entries(sample_components.stateless(), stop_time=1.0, step_size=0.1)
    text = files[DESCRIPTION].decode()
    assert text.count('name="y"') == 1
    return {**files, DESCRIPTION: text.replace('name="y"', f'name="{name}"').encode()}


@pytest.mark.parametrize("name", VALID)
def test_a_valid_name_is_written(name: str, tmp_path: Path) -> None:
    path = write_fmu(renamed(name), tmp_path, "gain")
    assert validate_fmu(str(path)) == findings(str(path)) == []


@pytest.mark.parametrize("name", INVALID)
def test_another_name_is_refused_by_fmpy(name: str, tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=r"(?s)`gain` fails validation.*is not a legal"):
        write_fmu(renamed(name), tmp_path, "gain")
    assert not [*tmp_path.iterdir()]
