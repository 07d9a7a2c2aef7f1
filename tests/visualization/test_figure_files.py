"""Matplotlib as a command loads it: quicker, and with the same pictures."""

import subprocess
import sys

DRAW = """
import hashlib
import sys
from hapticlink.visualization import figure_files
if sys.argv[1] == "quick":
    figure_files.load_matplotlib()
from hapticlink.visualization.shown_figure import ShownFigure
from matplotlib.artist import Artist, kwdoc
axes = ShownFigure().subplots()
(line,) = axes.plot([0, 1], [0, 1], label="a line")
line.set(lw=2, color="r", marker="o")
axes.set(title="a title", xlim=(0, 2))
axes.legend()
print(*(hashlib.sha256(figure_files.encode(axes.figure, k)).hexdigest() for k in ("png", "pdf")))
print("set" in vars(type(line)), Artist.set.__qualname__, "linewidth" in kwdoc(type(line)))
"""


def draw(how: str) -> list[str]:
    command = [sys.executable, "-c", DRAW, how]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_a_command_draws_the_same_without_lists_of_properties_in_docstrings() -> None:
    (usual, made), (quick, inherited) = draw("as usual"), draw("quick")
    assert quick == usual
    assert made == "True Artist.set True"
    assert inherited == "False Artist.set True"  # spared, and Matplotlib is then as it was
