"""documentation/index.html of an FMU, generated from the component."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from hapticlink.components.component import Component, Variable

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 52em; margin: 2em auto; padding: 0 1em; }
pre { background: #f4f6f8; padding: .8em; overflow-x: auto; }
figure { margin: 1em 0; }
img { max-width: 100%; }
figcaption { color: #556; }
table { border-collapse: collapse; width: 100%; }
th, td { border-bottom: 1px solid #ccd; padding: .25em .6em; text-align: left; }
"""

TIMING = {
    "continuous": "Continuous block: outputs are those of the end of its step.",
    "sampled": "Sampled block: a step that starts at t with the inputs of t puts out y(t), "
    "valid until the step ends.",
}


def documentation(component: Component) -> bytes:
    """One HTML page without external references."""
    steps = component.substeps
    times = "once" if steps == 1 else f"in {steps} equal substeps"
    body = [
        f"<h1>{escape(component.name)}</h1>",
        f"<p>{escape(component.description)}</p>",
        f"<p>{TIMING[component.timing]} Each communication step is taken {times}.</p>",
        *_paragraphs(component.documentation),
        *_table("Inputs", component.inputs),
        *_table("Parameters", component.parameters),
        *_table("Outputs", component.outputs),
    ]
    page = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(component.name)}</title><style>{STYLE}</style></head><body>",
        *body,
        "</body></html>",
    ]
    return "\n".join(page).encode() + b"\n"


def _paragraphs(text: str) -> list[str]:
    """Paragraphs of a docstring, separated by blank lines; indented ones, such as equations, are
    preformatted."""
    blocks = [block.strip("\n") for block in text.split("\n\n") if block.strip()]
    return [
        f"<pre>{escape(block)}</pre>" if block.startswith("  ") else f"<p>{escape(block)}</p>"
        for block in blocks
    ]


def _table(title: str, variables: Sequence[Variable]) -> list[str]:
    if not variables:
        return []
    has_start = title != "Outputs"
    heads = ["name", "shape", "unit", *(["start"] if has_start else []), "description"]
    if title == "Parameters":
        heads.insert(4, "may change")
    rows = []
    for v in variables:
        cells = [v.name, " x ".join(map(str, v.shape)) or "scalar", _short(v.units)]
        if has_start:
            cells.append(_short(tuple(repr(float(start)) for start in v.starts)))
        if title == "Parameters":
            cells.append("any time" if v.variability == "tunable" else "before the run")
        rows.append("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in [*cells, v.description]))
    head = "".join(f"<th>{h}</th>" for h in heads)
    return [f"<h2>{title}</h2>", f"<table><tr>{head}</tr>", *(row + "</tr>" for row in rows),
            "</table>"]  # fmt: skip


def _short(values: tuple[str, ...]) -> str:
    """The values as text, a single one if all are the same."""
    return values[0] if len(set(values)) == 1 else ", ".join(values)
