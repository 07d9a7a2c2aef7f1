"""The public names of `import hapticlink as hl`, their page and the script of first steps."""

import base64
import inspect
import os
import pydoc
import subprocess
import sys
from pathlib import Path

import pytest

import hapticlink as hl
from docs import make_api, make_course
from tests.notebooks import execute

SCRIPT = Path(__file__).parents[1] / "docs" / "first_steps.py"


def test_names_are_there_for_people_type_checkers_and_help() -> None:
    assert dir(hl) == sorted(hl.__all__)
    assert all(getattr(hl, name) is not None for name in hl.__all__)
    said = pydoc.render_doc(hl, renderer=pydoc.plaintext)
    assert all(name in said for name in hl.__all__ if name != "__version__")
    assert f"VERSION\n    {hl.__version__}" in said
    with pytest.raises(AttributeError, match="no attribute 'simulate'"):
        hl.simulate  # type: ignore[attr-defined]  # noqa: B018
    with pytest.raises(AttributeError, match=r"'export_results' any more: .*to_parquet"):
        hl.export_results  # type: ignore[attr-defined]  # noqa: B018


def test_names_load_what_is_behind_them_when_they_are_used() -> None:
    code = (
        "import sys, hapticlink as hl\n"
        "hl.__version__\n"
        "print([m for m in ('casadi', 'numpy', 'matplotlib', 'cyclopts') if m in sys.modules])\n"
        "hl.run\n"
        "print('numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["[]", "True"]


@pytest.mark.parametrize("name", [n for n in hl.__all__ if inspect.isfunction(getattr(hl, n))])
def test_every_parameter_is_told(name: str) -> None:
    function = getattr(hl, name)
    told = (inspect.getdoc(function) or "") + (inspect.getdoc(hl.scene) or "")
    for parameter in inspect.signature(function).parameters:
        assert parameter in told, f"{name}({parameter})"


def test_the_page_is_made_from_the_docstrings_as_they_are() -> None:
    assert make_api.PAGE.read_text(encoding="utf-8") == make_api.page(), (
        "run `python docs/make_api.py`"
    )


def test_the_first_steps_run(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "--set graphics.rte=10: graphics.rte: unknown key; did you mean 'rate'?" in done.stdout
    most = [line for line in done.stdout.splitlines() if line.startswith(("zoh at", "foh at"))]
    assert len(most) == 4
    assert {p.name for p in (tmp_path / "runs/first-steps").iterdir()} >= {
        "run.json", "plan.txt", "haptics.csv", "graphics.csv", "distance.png",
    }  # fmt: skip
    assert {p.name for p in (tmp_path / "fmus/five-bar").iterdir()} == {
        "hand.fmu", "virtual_mechanism.fmu",
    }  # fmt: skip
    assert not list(tmp_path.glob("hapticlink-*"))  # no temporary folder is left


def test_the_first_steps_show_themselves_in_a_notebook(tmp_path: Path) -> None:
    """Each in the cell whose value it is: verdict, mechanism and three numbers of a run, the
    picture of a figure, the table of a comparison, a replay."""
    text = make_course.as_text(make_course.cells(SCRIPT.read_text(encoding="utf-8")))
    shown = {cell["source"][-1]: cell["outputs"] for cell in execute(text, tmp_path)}
    value = {
        last: found[-1]["data"] for last, found in shown.items() if "data" in (found or [{}])[-1]
    }
    run = "".join(value["r"]["text/html"])
    assert ": done at 1 s" in "".join(shown["r"][0]["text"])
    assert "<p><b>done at 1 s</b></p>" in run
    assert run.count("<img ") == 1
    assert run.count("<li>") == 3
    for figure in ('r.figures()["distance"]', "s.figure()"):
        assert base64.b64decode(value[figure]["image/png"]).startswith(b"\x89PNG")
    compared = "".join(value["hl.compare(runs)"]["text/html"])
    assert compared.count("<img ") == 1
    assert "<td>passive</td>" in compared
    assert "<iframe " in value['hl.view(runs["zoh"], runs["passive"])']["text/html"][0]
