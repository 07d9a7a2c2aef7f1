"""docs/first_steps.py as a notebook, executed."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

SCRIPT = Path(__file__).parents[2] / "docs" / "first_steps.py"


def notebook(folder: Path) -> list[dict[str, Any]]:
    """The cells of code with their outputs, after `jupyter nbconvert --execute` in `folder`."""
    made = {"cells": cells(SCRIPT.read_text()), "metadata": {}, "nbformat": 4, "nbformat_minor": 4}
    path = folder / "first_steps.ipynb"
    path.write_text(json.dumps(made))
    command = ["-m", "nbconvert", "--to", "notebook", "--execute", "--inplace", path.name]
    done = subprocess.run(
        [sys.executable, *command], cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "TMPDIR": str(folder), "IPYTHONDIR": str(folder / "ipython")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return [c for c in json.loads(path.read_text())["cells"] if c["cell_type"] == "code"]


def cells(script: str) -> list[dict[str, Any]]:
    """The cells of a script, each from a line `# %%` on; text is commented."""
    found = []
    for title, text in re.findall(r"^# %%(.*)\n((?:(?!# %%).*\n?)*)", script, re.MULTILINE):
        if "[markdown]" in title:
            source = re.sub("^# ?", "", text.strip(), flags=re.MULTILINE)
            found.append({"cell_type": "markdown", "metadata": {}, "source": source})
        else:
            code = {"cell_type": "code", "metadata": {}, "outputs": [], "execution_count": None}
            found.append(code | {"source": text.strip()})
    return found
