"""Notebooks, executed."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest


def execute(text: str, folder: Path) -> list[dict[str, Any]]:
    """The cells of code of a notebook with their outputs, after `nbconvert --execute` in `folder`;
    a cell that raises fails the test."""
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    pytest.importorskip("nbconvert", reason="nbconvert is not installed")
    path = folder / "notebook.ipynb"
    path.write_text(text, encoding="utf-8")
    command = ["-m", "nbconvert", "--to", "notebook", "--execute", "--inplace", path.name]
    done = subprocess.run(
        [sys.executable, *command], cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "TMPDIR": str(folder), "IPYTHONDIR": str(folder / "ipython")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in found if cell["cell_type"] == "code"]
