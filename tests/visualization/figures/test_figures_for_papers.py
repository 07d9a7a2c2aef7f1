"""Figures that a paper takes as they are: files, fonts, colours and texts within their page."""

import itertools
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import hapticlink as hl
from hapticlink.visualization.curve_colours import CURVES
from hapticlink.visualization.figure_axes import in_lines
from hapticlink.visualization.figure_files import encode
from hapticlink.visualization.figures import run_figures, sweep_figure
from tests.shared_fixtures import run_once

# Machado, Oliveira, Fernandes 2009: linear RGB as seen without one kind of cones.
SEEN = {
    "all cones": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}  # fmt: skip
TO_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
) / [[0.9505], [1.0], [1.089]]  # fmt: skip


def lab(linear: np.ndarray) -> np.ndarray:
    """CIE L*a*b* (D65) of linear sRGB."""
    xyz = TO_XYZ @ np.clip(linear, 0, 1)
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def linear(colour: str) -> np.ndarray:
    c = np.array(to_rgb(colour))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def test_curves_stay_apart_in_grey() -> None:
    lightness = sorted(lab(linear(colour))[0] for colour in CURVES)
    assert np.diff(lightness).min() > 10
    assert lightness[-1] < 90  # and from the page


@pytest.mark.parametrize("cones", SEEN)
def test_curves_stay_apart_to_every_kind_of_cones(cones: str) -> None:
    seen = [lab(SEEN[cones] @ linear(colour)) for colour in CURVES]
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)]
    assert min(apart) > 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of a run."""
    made = tmp_path_factory.mktemp("vectors")
    hl.run("enclosure", {"duration": 0.1}, out=made, format="pdf, svg")
    return made


def test_vector_figures_are_written_whole_and_say_so(folder: Path) -> None:
    names = {*run_figures.drawings(hl.load(folder))}
    assert names >= {"mechanism", "forces", "constraints", "user_port"}
    files = {f"{name}.{kind}" for name in names for kind in ("pdf", "svg")}
    assert files <= {*hl.load(folder).run["files"]}
    assert not [*folder.glob("*.png")]
    for name in names:
        assert ET.parse(folder / f"{name}.svg").getroot().tag == "{http://www.w3.org/2000/svg}svg"
        pdf = (folder / f"{name}.pdf").read_bytes()
        assert pdf.startswith(b"%PDF-")
        at = int(re.findall(rb"startxref\n(\d+)\n%%EOF\n$", pdf)[0])
        assert pdf[at:].startswith(b"xref")


def test_fonts_are_embedded(folder: Path) -> None:
    for file in folder.glob("*.pdf"):
        pdf = file.read_bytes()
        assert b"/Type3" not in pdf
        fonts = len(re.findall(rb"/Type /FontDescriptor", pdf))
        assert fonts == len(re.findall(rb"/FontFile2 ", pdf)) > 0
    for file in folder.glob("*.svg"):
        assert "<text" not in file.read_text(encoding="utf-8")  # outlines, which need no font


@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_the_same_run_has_the_same_files(folder: Path, kind: str) -> None:
    drawn = run_figures.drawings(hl.load(folder))["forces"]()
    assert encode(drawn, kind) == (folder / f"forces.{kind}").read_bytes()


def test_an_unknown_format_is_refused_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(hl.InputFault, match=r"--format pdf,esp: no format 'esp'"):
        hl.run("enclosure", out=tmp_path / "run", format="pdf,esp")
    with pytest.raises(hl.InputFault, match="--format tiff"):
        hl.sweep("enclosure", {"duration": [0.1]}, out=tmp_path / "sweep", format="tiff")
    assert not [*tmp_path.iterdir()]


def test_a_sweep_is_drawn_in_each_format_that_is_asked_for(tmp_path: Path) -> None:
    vary = {"haptics.rate": [400, 512], "duration": [0.02]}
    assert hl.sweep("five-bar", vary, out=tmp_path, jobs=1).files == ("table.csv", "sweep.png")
    again = hl.sweep("five-bar", vary, out=tmp_path, jobs=1, format="pdf,svg,png")
    assert again.files == ("table.csv", "sweep.pdf", "sweep.svg", "sweep.png")
    written = {name: (tmp_path / name).stat().st_mtime_ns for name in again.files[1:]}
    hl.sweep("five-bar", vary, out=tmp_path, jobs=1, format="pdf,svg,png")
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in written} == written


def outside(figure: Figure) -> list[str]:
    """What of a figure is drawn beyond its edges: axes with titles, names and ticks in view, and
    legends."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    width, height = figure.bbox.size
    found = []
    for artist in (*figure.axes, *figure.legends, *figure.texts):
        box = artist.get_tightbbox(canvas.get_renderer())
        assert box
        if min(box.x0, box.y0) < 0 or box.x1 > width or box.y1 > height:
            found.append(f"{artist}: {box}")
    return found


SCENES = (
    "closed-loop", "closed-loop-ideal", "closed-loop-b1", "enclosure", "obstacles", "two-users",
    "two-hands", "slider-crank", "jansen", "sampled-spring",
)  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
def test_nothing_stands_beyond_the_page(scene: str) -> None:
    for name, figure in run_figures.figures(run_once(scene, ["duration=0.3"])).items():
        assert not outside(figure), name


def test_no_two_curves_of_a_figure_look_alike() -> None:
    """Of seven sources of energy, one more than there are colours."""
    figure = run_figures.figures(run_once("enclosure"))["user_port"]
    lines = [line for line in figure.axes[0].lines if not line.get_label().startswith("_")]
    looks = {(line.get_color(), line.get_linestyle(), line.get_linewidth()) for line in lines}
    assert len(looks) == len(lines) > len(CURVES) + 3


def test_titles_are_above_their_axes_and_below_the_edge() -> None:
    found = run_once("closed-loop-ideal", ["graphics.rate=10", "controller.topology=false"])
    for name, figure in run_figures.figures(found).items():  # with the reason of an early end
        FigureCanvasAgg(figure).draw()
        axes = figure.axes[0]
        assert axes.title.get_window_extent().y0 > axes.bbox.y1, name
        assert axes.title.get_window_extent().y1 < figure.bbox.y1, name


def test_lines_of_a_title_are_even_and_keep_numbers_with_their_units() -> None:
    text = "Tracking error up to 4.63 mm, at 2.08 s; 11 % of the samples constrained"
    for width in range(20, 80):
        lines = in_lines(text, width).split("\n")
        assert " ".join(" ".join(lines).split()) == text
        assert max(map(len, lines)) <= width
        assert not any(re.search(r"\d$", line) for line in lines[:-1])
    first, second = in_lines(text, 70).split("\n")
    assert abs(len(first) - len(second)) < 10


@pytest.mark.parametrize(
    ("key", "label"),
    [
        ("graphics.rate", "graphics rate (Hz)"),
        ("linkage.body.link0.mass", "mass of link0 (kg)"),
        ("hold", "hold"),
        ("mechanism_at", "mechanism at"),
        ("fmu.wall.start.damping", "damping of wall"),
        ('delays."wall.F"', "delay of wall.F (s)"),
        ("delays.hand.F", "delay of hand.F (s)"),
    ],
)
def test_axes_of_a_sweep_are_in_words(key: str, label: str) -> None:
    assert sweep_figure.axis(key) == label


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("hold of controller.F_motor", "hold of the motor force"),
        ("hold of controller.left.F_motor", "left: hold of the motor force"),
        (
            "hold of controller.F_drift on the mechanism",
            "hold of the coupling force on the mechanism",
        ),
        ("drift", "virtual coupling, F_drift"),
    ],
)
def test_sources_of_energy_are_in_words(block: str, said: str) -> None:
    assert run_figures._source(block) == said
