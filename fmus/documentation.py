"""documentation/index.html of an FMU, generated from the component, with drawings of its ports and
its reference run as SVG."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from hapticlink.components.component import Component, Variable
from hapticlink.fmus.reference_run import ReferenceRun

PAGE = "documentation/index.html"
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 52em; margin: 2em auto; padding: 0 1em; }
pre { background: #f4f6f8; padding: .8em; overflow-x: auto; }
figure { margin: 1em 0; }
img { max-width: 100%; }
figcaption { color: #556; }
svg { width: 100%; font: 13px system-ui, sans-serif; }
svg .name { font-weight: 600; font-size: 15px; }
svg .box { fill: #f4f6f8; stroke: #556; }
svg .arrow, svg .input, svg .output { fill: none; stroke: #556; stroke-width: 1.2; }
svg .output { stroke: #1763a6; }
table { border-collapse: collapse; width: 100%; }
th, td { border-bottom: 1px solid #ccd; padding: .25em .6em; text-align: left; }
"""

TIMING = {
    "continuous": "Continuous block: outputs are those of the end of its step.",
    "frame": "Frame block: a step from t to t + h puts out, at t + h, what it computes from "
    "the inputs of t.",
    "sampled": "Sampled block: a step that starts at t with the inputs of t puts out y(t), "
    "valid until the step ends.",
}


PYTHON_PATHS = (
    "This FMU runs on Python. A tool has to unpack it in a folder whose path has letters of ASCII, "
    "digits, spaces and - . _ ~ alone: with others, the library of pythonfmu ends the tool's "
    "process. FMPy takes the temporary folder, TMPDIR."
)


def documentation(
    component: Component, run: ReferenceRun | None = None, on_python: bool = False
) -> bytes:
    """One HTML page without external references, with the block's ports as a drawing, and what it
    does in `run`."""
    steps = component.substeps
    times = "once" if steps == 1 else f"in {steps} equal substeps"
    body = [
        f"<h1>{escape(component.name)}</h1>",
        f"<p>{escape(component.description)}</p>",
        f"<p>{TIMING[component.timing]} Each communication step is taken {times}.</p>",
        *([f"<p>{PYTHON_PATHS}</p>"] if on_python else []),
        f"<figure>{diagram(component)}</figure>",
        *_paragraphs(component.documentation),
        *(_run(run) if run and len(run.times) else []),
        *_table("Inputs", component.inputs),
        *_table("Parameters", component.parameters),
        *_table("Outputs", component.outputs),
    ]
    return page(component.name, body)


def page(title: str, body: Iterable[str]) -> bytes:
    """A page of HTML with its style."""
    head = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(title)}</title><style>{STYLE}</style></head><body>",
    ]
    return "\n".join([*head, *body, "</body></html>", ""]).encode()


def table(title: str, heads: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """A table under its title; nothing without rows."""
    lines = ["<tr>" + "".join(f"<td>{escape(c)}</td>" for c in cells) + "</tr>" for cells in rows]
    head = "".join(f"<th>{name}</th>" for name in heads)
    return [f"<h2>{title}</h2>", f"<table><tr>{head}</tr>", *lines, "</table>"] if lines else []


def _run(run: ReferenceRun) -> list[str]:
    moved = f"{', '.join(run.moved)} moved by sines, other inputs at their start values"
    return [
        "<h2>Reference run</h2>",
        f"<figure>{strips(run)}<figcaption>The block alone, from its start values, over "
        f"{run.duration:g} s: {moved if run.moved else 'no input moves it'}. "
        "Inputs are grey, outputs blue; beside each strip its greatest and its least value."
        "</figcaption></figure>",
    ]


def _paragraphs(text: str) -> list[str]:
    """Paragraphs of a docstring, separated by blank lines; indented ones, such as equations, are
    preformatted."""
    blocks = [block.strip("\n") for block in text.split("\n\n") if block.strip()]
    return [
        f"<pre>{escape(block)}</pre>" if block.startswith("  ") else f"<p>{escape(block)}</p>"
        for block in blocks
    ]


def _table(title: str, variables: Sequence[Variable]) -> list[str]:
    heads = ["name", "shape", "unit", *(["start"] if title != "Outputs" else []), "description"]
    if title == "Parameters":
        heads.insert(4, "may change")
    rows = []
    for v in variables:
        cells = [v.name, " x ".join(map(str, v.shape)) or "scalar", _short(v.units)]
        if title != "Outputs":
            cells.append(_short(tuple(repr(float(start)) for start in v.starts)))
        if title == "Parameters":
            cells.append("any time" if v.variability == "tunable" else "before the run")
        rows.append([*cells, v.description])
    return table(title, heads, rows)


def _short(values: tuple[str, ...]) -> str:
    """The values as text, a single one if all are the same."""
    return values[0] if len(set(values)) == 1 else ", ".join(values)


WIDTH, ROW, BOX = 760, 22, 200
STRIP, SHOWN = 46, 8
"""Height of a strip, and how many are drawn of inputs and of outputs at most."""


def diagram(component: Component) -> str:
    """The block as a box between its inputs and its outputs, each with its shape and unit."""
    columns = component.inputs, component.outputs
    height = ROW * (1 + max(2, *map(len, columns)))
    left, right = (WIDTH - BOX) / 2, (WIDTH + BOX) / 2
    parts = [
        f'<rect x="{left}" y="1" width="{BOX}" height="{height - 2}" rx="6" class="box"/>',
        _text(WIDTH / 2, height / 2, component.name, "middle", "name"),
        _text(WIDTH / 2, height / 2 + 18, component.timing, "middle"),
    ]
    for variables, x, anchor, far in (
        (component.inputs, left, "end", left - 30),
        (component.outputs, right, "start", right + 30),
    ):
        for y, variable in zip(_places(variables, height), variables, strict=True):
            start, end = sorted((x, far))
            parts.append(f'<path d="M{start} {y}H{end}" class="arrow"/>')
            parts.append(
                f'<path d="M{end - 7} {y - 4}L{end} {y}L{end - 7} {y + 4}" class="arrow"/>'
            )
            gap = -6 if anchor == "end" else 6
            parts.append(_text(far + gap, y + 4, _port(variable), anchor))
    return _svg(height, parts, f"{component.name} with its inputs and outputs")


def strips(run: ReferenceRun) -> str:
    """What moved over time, each on a scale of its own from its least to its greatest value; all
    outputs where none did."""
    moving = {name: values for name, values in run.answers.items() if np.ptp(values) > 0}
    kinds = ("input", run.moved), ("output", moving or run.answers)
    rows = [(kind, *row) for kind, of in kinds for row in list(of.items())[:SHOWN]]
    parts = []
    for k, (kind, name, values) in enumerate(rows):
        parts += _strip(kind, name, values, k * STRIP)
    return _svg(len(rows) * STRIP, parts, "reference run")


def _places(variables: Sequence[Variable], height: float) -> list[float]:
    """Heights (px) at which the ports of one side are drawn, about the middle."""
    top = (height - ROW * (len(variables) - 1)) / 2
    return [top + ROW * k for k in range(len(variables))]


def _port(variable: Variable) -> str:
    shape = " x ".join(map(str, variable.shape))
    units = dict.fromkeys(variable.units)
    told = ", ".join(units) if len(variable.shape) < 2 and [*units] != ["1"] else ""
    return " ".join(filter(None, (variable.name, shape and f"[{shape}]", told)))


def _strip(kind: str, name: str, values: np.ndarray, top: int) -> list[str]:
    low, high = float(values.min()), float(values.max())
    x = np.linspace(130, WIDTH - 110, len(values))
    y = top + 6 + (STRIP - 12) * (high - values) / ((high - low) or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return [
        _text(120, top + STRIP / 2 + 4, name, "end"),
        f'<polyline points="{points}" class="{kind}"/>',
        _text(WIDTH - 100, top + 14, f"{high:.3g}", "start"),
        _text(WIDTH - 100, top + STRIP - 5, f"{low:.3g}", "start"),
    ]


def _text(x: float, y: float, text: str, anchor: str, kind: str = "") -> str:
    named = f' class="{kind}"' if kind else ""
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}"{named}>{escape(text)}</text>'


def _svg(height: float, parts: Sequence[str], label: str) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH} {height:g}" role="img" aria-label="{escape(label)}">'
        + "".join(parts)
        + "</svg>"
    )
