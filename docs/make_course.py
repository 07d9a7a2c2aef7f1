"""Writes the notebooks in docs/course/ from the scripts in docs/course/source/:

python docs/make_course.py

Each script there has the cells of a worksheet and of its solution, from a line `# %%` on. A cell
is in both, `# %% blank` in the worksheet alone, `# %% answer` in the solution alone; text is
`# %% [markdown]`. Notebooks have no outputs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

COURSE = Path(__file__).parent / "course"
LEFT_OUT = {COURSE: "answer", COURSE / "solutions": "blank"}
"""By folder of notebooks, the mark of the cells that they do not have."""


def cells(script: str, left_out: str = "") -> list[dict[str, Any]]:
    """The cells of a script but for those that are marked as left out; text is commented."""
    found = []
    for title, text in re.findall(r"^# %%(.*)\n((?:(?!# %%).*\n?)*)", script, re.MULTILINE):
        marks = title.split()
        if left_out in marks:
            continue
        code = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
        cell: dict[str, Any] = code
        if "[markdown]" in marks:
            text = re.sub("^# ?", "", text.strip(), flags=re.MULTILINE)
            cell = {"cell_type": "markdown", "metadata": {}}
        found.append(cell | {"source": text.strip().splitlines(keepends=True)})
    return found


def as_text(found: list[dict[str, Any]]) -> str:
    """A notebook of cells, as Jupyter writes it."""
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made = {
        "cells": found,
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 4,
    }
    return json.dumps(made, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def notebooks() -> Iterator[tuple[Path, str]]:
    """The path and the text of each notebook."""
    for script in sorted((COURSE / "source").glob("*.py")):
        for folder, left_out in LEFT_OUT.items():
            text = as_text(cells(script.read_text(encoding="utf-8"), left_out))
            yield folder / f"{script.stem}.ipynb", text


if __name__ == "__main__":
    (COURSE / "solutions").mkdir(exist_ok=True)
    for path, text in notebooks():
        path.write_text(text, encoding="utf-8")
        print(path)
