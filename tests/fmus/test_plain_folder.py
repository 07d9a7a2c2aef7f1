"""Python FMUs where the path of the folder for temporary files has characters that their library
does not read."""

import re
import tempfile

import pytest

from hapticlink.fmus import plain_folder
from hapticlink.fmus.check import session
from hapticlink.fmus.errors import FmuError
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, fault, fmu_table, process, scene
from tests.shared_fixtures import status


@pytest.mark.parametrize("odd", ["t[1]", "a#b", "a+b", "50%20", "(a)", "a,b@c", "M\u00fcller"])
def test_python_fmus_run_wherever_the_temporary_folder_is(tmp_path, odd):
    """One of others, isolated and not, and one that is built, and so checked, for the run."""
    folder = tmp_path / odd
    folder.mkdir()
    python_fmu(tmp_path, "Here")
    both = fmu_table("here", "Here") + fmu_table("alone", "Here", ISOLATED)
    block = '[[fmu]]\nname = "wall"\nblock = "virtual_wall"\nsettings = { stiffness = 9.0 }\n'
    path = scene(tmp_path, both + block)
    environment = {"TMPDIR": str(folder), "HAPTICLINK_CACHE": str(tmp_path / "cache")}
    ended = process(path, tmp_path / "out", **environment)
    assert ended.returncode == 0, ended.stderr
    assert [*folder.iterdir()] == []


def test_without_such_a_folder_they_are_refused_with_the_remedy(tmp_path, monkeypatch):
    folder = tmp_path / "t[1]"
    folder.mkdir()
    path = python_fmu(tmp_path, "Here")
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr(plain_folder, "_others", lambda: ())
    remedy = r"its library does not read \[ \] in a path; set TMPDIR to a folder whose path has"
    with pytest.raises(FmuError, match=remedy):
        session(path)
    said = fault(tmp_path, fmu_table("here", "Here"))
    assert "here: could not be loaded: a Python FMU cannot be loaded from" in said
    assert re.search(remedy, said)
    native = ("--set", "packaging=native", "--set", "duration=0.1")
    assert status("run", "pendulum", *native, "--no-figures", "--out", tmp_path / "native") == 0
    assert [*folder.iterdir()] == []
