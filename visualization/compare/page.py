"""A report of one run or of several beside each other, as one HTML file without scripts."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hapticlink.orchestrator.results.scene_file import scene_file
from hapticlink.orchestrator.results.tables import Results
from hapticlink.visualization.compare import numbers, overlay, settings
from hapticlink.visualization.compare.numbers import Row
from hapticlink.visualization.figure_axes import plain
from hapticlink.visualization.figures import run_figures as of_a_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = Path(__file__).with_name("page.css")
FAULTS = ("fault", "warnings", "holds generate more than is put in")
"""Rows that are shown as bad where they say anything."""
FINE = ("none", "no", numbers.NONE)


def page(runs: Mapping[str, Results]) -> str:
    """The page of runs by the names that tell them apart. The same runs give the same bytes."""
    every, names = list(runs.values()), list(runs)
    titles = dict.fromkeys(run.record.scene["title"] for run in every)
    parts = [f"<h1>{escape('; '.join(titles))}</h1>"]
    if other := settings.other_scenes(every):
        parts.append(f'<p class="note">{escape(other)}</p>')
    for title, rows in numbers.sections(every).items():
        if rows:
            parts += [f"<h2>{escape(title)}</h2>", _table(names, rows)]
        if title.startswith(numbers.PERFORMANCE):
            parts += _figures(runs)
    if len(every) > 1:
        rows = [Row(key, values) for key, values in settings.differing(every).items()]
        table = _table(names, rows) if rows else "<p>None: the scenes are the same.</p>"
        parts += ["<h2>Settings that differ</h2>", table]
    parts += ["<h2>How to make it again</h2>", *_again(runs)]
    style = STYLE.read_text(encoding="utf-8")
    head = (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape('; '.join(titles))}</title>\n"
        f"<style>\n{style}</style>\n</head>\n<body>\n"
    )
    return head + "\n".join(parts) + "\n</body>\n</html>\n"


def _table(names: Sequence[str], rows: Sequence[Row]) -> str:
    """A table of rows; a row that is the same for all runs says so once."""
    head = "".join(f"<th>{escape(name)}</th>" for name in ("", *names))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(map(_row, rows))}</tbody></table>"


def _row(row: Row) -> str:
    several = len(row.values)
    shown = row.values[:1] if several > 1 and len({*row.values}) == 1 else row.values
    span = f' colspan="{several}"' if len(shown) < several else ""
    cells = "".join(f"<td{span}{_bad(row.label, value)}>{escape(value)}</td>" for value in shown)
    return f"<tr><th>{escape(row.label)}</th>{cells}</tr>\n"


def _bad(label: str, value: str) -> str:
    return ' class="bad"' if label in FAULTS and value not in FINE else ""


def _figures(runs: Mapping[str, Results]) -> Iterator[str]:
    """Those of a run; of several, what they have over each other and the drawing of each."""
    if len(runs) == 1:
        (run,) = runs.values()
        for name, figure in of_a_run.figures(run).items():
            yield _picture(name, figure)
        return
    for name, figure in overlay.figures(runs).items():
        yield _picture(name, figure)
    for name, run in runs.items():
        if drawn := of_a_run.figures(run).get("mechanism"):
            drawn.axes[0].set_title(plain(name), fontsize="medium")
            yield _picture(f"mechanism, {name}", drawn)


def _picture(name: str, figure: Figure) -> str:
    file = io.BytesIO()
    kept: dict[str, Any] = {"metadata": {"Software": None}}  # the same bytes every time
    figure.savefig(file, format="png", dpi=110, **kept)
    data = base64.b64encode(file.getvalue()).decode()
    return f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{data}"></figure>'


def _again(runs: Mapping[str, Results]) -> Iterator[str]:
    yield (
        "<p>Save a scene as <code>scene.toml</code>, then <code>hapticlink run scene.toml</code>. "
        "With the versions above it gives the same tables.</p>"
    )
    for name, run in runs.items():
        text = escape(scene_file(run))
        yield f"<details><summary>scene of {escape(name)}</summary><pre>{text}</pre></details>"
