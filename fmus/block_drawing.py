"""Drawings of a block for its page of documentation, as SVG: its ports, and its reference run."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from hapticlink.components.component import Component, Variable
from hapticlink.fmus.reference_run import ReferenceRun

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
