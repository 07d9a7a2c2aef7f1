"""Draws the picture of docs/export-results.md with the lines of Python that stand there:

python docs/draw_export_results.py
"""

from __future__ import annotations

import re
import shutil
import tempfile
from contextlib import chdir
from pathlib import Path

import matplotlib as mpl

import hapticlink as hl

PAGE = Path(__file__).with_name("export-results.md")
PICTURE = PAGE.parent / "figures" / "parquet.png"


def main() -> None:
    mpl.use("agg")
    (lines,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    with tempfile.TemporaryDirectory() as room, chdir(room):
        hl.run("closed-loop", out="runs/five-bar", figures=False)
        hl.export_results("runs/five-bar", to="parquet")
        exec(lines, {})
        shutil.copyfile(PICTURE.name, PICTURE)


if __name__ == "__main__":
    main()
