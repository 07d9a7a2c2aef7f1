"""The worksheets of docs/course/ and their solutions: as their scripts make them, and executed."""

import base64
import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from docs import make_course
from tests.docs.pages import ROOT
from tests.notebooks import execute

COURSE = ROOT / "docs" / "course"
WORKSHEETS = sorted(COURSE.glob("*.ipynb"))
SOLUTIONS = sorted((COURSE / "solutions").glob("*.ipynb"))


def name(path: Path) -> str:
    return path.stem


def pictures(path: Path, folder: Path) -> int:
    """How many cells draw a figure, in a notebook that is executed."""
    data = [
        output.get("data", {})
        for cell in execute(path.read_text(encoding="utf-8"), folder)
        for output in cell["outputs"]
    ]
    return sum(base64.b64decode(d.get("image/png", "")).startswith(b"\x89PNG") for d in data)


def source(path: Path, kind: str) -> list[str]:
    found = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == kind]


def test_notebooks_are_made_from_their_scripts_as_they_are() -> None:
    made = dict(make_course.notebooks())
    assert {*made} == {*WORKSHEETS, *SOLUTIONS}
    for path, text in made.items():
        assert path.read_text(encoding="utf-8") == text, "run `python docs/make_course.py`"


@pytest.mark.parametrize("path", SOLUTIONS, ids=name)
def test_a_solution_runs_and_its_numbers_are_right(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each number of an answer is asserted in the cell below it. Its cells in this process: those
    of worksheets run as notebooks."""
    drawn: list[int] = []

    def show() -> None:
        drawn.append(len(plt.get_fignums()))
        plt.close("all")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", show)
    cells, names = source(path, "code"), {"__name__": "__main__"}
    for text in cells:
        exec(compile(text, str(path), "exec"), names)
    assert drawn == [1] * sum("plt.show()" in text for text in cells)
    assert len(drawn) >= 3
    assert sum("assert" in text for text in cells) >= 4


@pytest.mark.parametrize("path", WORKSHEETS, ids=name)
def test_a_worksheet_runs_with_its_blanks(path: Path, tmp_path: Path) -> None:
    assert pictures(path, tmp_path) >= 3


@pytest.mark.parametrize("path", WORKSHEETS, ids=name)
def test_a_worksheet_asks_before_it_shows_and_gives_no_answer_away(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    asked = ""
    for cell in cells:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            asked = text
        elif "plt.show()" in text:
            assert "**Predict" in asked, text
    solution = COURSE / "solutions" / path.name
    for kind in ("code", "markdown"):
        answers = {*source(solution, kind)} - {*source(path, kind)}
        assert answers
    blanks = [text for text in source(path, "code") if " = ..." in text or "return ..." in text]
    assert len(blanks) >= 4


RIGHT = {
    "virtual-wall": {
        "generated": "K / 2 * sum(np.diff(p) ** 2)",
        "K_passive": "2 * 5 * 512",
        "K_late": "5 / (1.5 * T)",
        "B_best": "0.8284 * m / T",
        "K_best": "0.6863 * m / T**2",
        "b_needed": "25",
    },
    "discrete-equivalents": {
        "T_forward": "b / K",
        "omega_60": "120 * np.arctan(5 / 6)",
        "rate_needed": "2.5e6",
        "T_held": "2 * b / K",
    },
    "five-bar": {
        "freedom": "2",
        "constrained": "1",
        "youngest": "1 / 30",
        "oldest": "1 / 15",
        "average": "0.05",
        "factor": "6",
        "held": "(F_held[:-1] * np.diff(x, axis=0)).sum()",
        "ideal": "((F[:-1] + F[1:]) / 2 * np.diff(x_fast, axis=0)).sum()",
        "B_now": "512 / mobility",
        "B_late": "256 / mobility",
    },
}
"""By worksheet, what fills its blanks."""


def filled(path: Path, answers: dict[str, str]) -> str:
    """A worksheet with its blanks filled in, those of its functions, too."""
    text = path.read_text(encoding="utf-8")
    for blank, answer in answers.items():
        text, count = re.subn(rf'"{blank} = \.\.\.', f'"{blank} = {answer}', text)
        assert count == 1, blank
    for rule in ("1 / (1 - s * T)", "(2 + s * T) / (2 - s * T)"):
        text = text.replace("return ...", f"return {rule}", 1)
    return text


@pytest.mark.parametrize("path", WORKSHEETS, ids=name)
def test_right_answers_are_accepted(path: Path, tmp_path: Path) -> None:
    text = filled(path, RIGHT[path.stem])
    assert " = ..." not in text
    said = "".join(
        "".join(output.get("text", ()))
        for cell in execute(text, tmp_path)
        for output in cell["outputs"]
    )
    assert said.count("right") + said.count("growth rate") + said.count("below") >= 3


def test_a_wrong_answer_is_refused(tmp_path: Path) -> None:
    wrong = filled(COURSE / "virtual-wall.ipynb", {"K_passive": "6000.0"})
    with pytest.raises(AssertionError, match="neither grow nor decay"):
        execute(wrong, tmp_path)
