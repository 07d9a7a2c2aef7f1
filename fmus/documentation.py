"""documentation/index.html of an FMU, generated from the component."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from hapticlink.components.component import Component, Variable
from hapticlink.fmus.block_drawing import diagram, strips
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
    "sampled": "Sampled block: a step that starts at t with the inputs of t puts out y(t), "
    "valid until the step ends.",
}


def documentation(component: Component, run: ReferenceRun | None = None) -> bytes:
    """One HTML page without external references, with the block's ports as a drawing, and what it
    does in `run`."""
    steps = component.substeps
    times = "once" if steps == 1 else f"in {steps} equal substeps"
    body = [
        f"<h1>{escape(component.name)}</h1>",
        f"<p>{escape(component.description)}</p>",
        f"<p>{TIMING[component.timing]} Each communication step is taken {times}.</p>",
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
