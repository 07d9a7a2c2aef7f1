"""A report of one run or of several beside each other, as one HTML file without scripts."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from hapticlink.analysis.findings import summary
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import scene_file
from hapticlink.visualization.compare import numbers, overlay, settings
from hapticlink.visualization.compare.numbers import Row
from hapticlink.visualization.figure_axes import plain
from hapticlink.visualization.figure_files import encode
from hapticlink.visualization.figures import run_figures as of_a_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = Path(__file__).with_name("page.css")
FAULTS = ("fault", "warnings", "holds generate more than is put in")
"""Rows that are shown as bad where they say anything."""
NUMBERS = 3
"""Of a run in its opening."""
WIDE = 8.0
"""Width (in) above which a figure takes the whole width of the page."""
FINE = ("none", "no", numbers.NONE)


def opening(runs: Mapping[str, Results], heading: str = "h1") -> str:
    """A headline, how each run ended, a picture, and of a single run three numbers."""
    every = list(runs.values())
    titles = dict.fromkeys(run.record.scene["title"] for run in every)
    if len(every) == 1:
        (run,) = every
        parts = [f"<{heading}>{escape(*titles)}</{heading}>", f"<p>{_verdict(run)}</p>"]
        if drawn := of_a_run.drawings(run).get("mechanism"):
            parts.append(_picture("mechanism", drawn()))
        lines = "".join(f"<li>{escape(x)}</li>" for x in islice(summary.numbers(run), NUMBERS))
        return "\n".join([*parts, f"<ul>{lines}</ul>" if lines else ""])
    figures = overlay.figures(runs)
    first = next((name for name in figures), None)
    headline = figures[first].axes[0].get_title() if first else "; ".join(titles)
    parts = [f"<{heading}>{escape(headline)}</{heading}>"]
    ends: dict[str, list[str]] = {}
    for name, run in runs.items():
        ends.setdefault(_verdict(run), []).append(name)
    parts += [f"<p>{escape(', '.join(names))}: {said}</p>" for said, names in ends.items()]
    if other := settings.other_scenes(every):
        parts.append(f'<p class="note">{escape(other)}</p>')
    return "\n".join([*parts, *([_picture(first, figures[first])] if first else [])])


def _verdict(run: Results) -> str:
    """How a run ended, with its fault."""
    if fault := run.record.fault:
        return f'<b class="bad">{escape(f"{summary.ending(run)}: {fault.message}")}</b>'
    return f"<b>{escape(summary.ending(run))}</b>"


def page(runs: Mapping[str, Results]) -> str:
    """The page of runs by the names that tell them apart. The same runs give the same bytes."""
    every, names = list(runs.values()), list(runs)
    titles = dict.fromkeys(run.record.scene["title"] for run in every)
    parts = [opening(runs)]
    for title, rows in numbers.sections(every).items():
        if rows:
            parts += [f"<h2>{escape(title)}</h2>", table(names, rows)]
        if title.startswith(numbers.PERFORMANCE):
            parts += _figures(runs)
    if len(every) > 1:
        rows = [Row(key, values) for key, values in settings.differing(every).items()]
        found = table(names, rows) if rows else "<p>None: the scenes are the same.</p>"
        parts += ["<h2>Settings that differ</h2>", found]
    parts += ["<h2>How to make it again</h2>", *_again(runs)]
    style = STYLE.read_text(encoding="utf-8")
    head = (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape('; '.join(titles))}</title>\n"
        f"<style>\n{style}</style>\n</head>\n<body>\n"
    )
    return head + "\n".join(parts) + "\n</body>\n</html>\n"


def table(names: Sequence[str], rows: Sequence[Row]) -> str:
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
    """Those that the opening lacks; of several runs, what they have over each other and the drawing
    of each."""
    if len(runs) == 1:
        (run,) = runs.values()
        drawings = of_a_run.drawings(run)
        drawings.pop("mechanism", None)
        for name, draw in drawings.items():
            yield _picture(name, draw())
        return
    for name, figure in [*overlay.figures(runs).items()][1:]:
        yield _picture(name, figure)
    for name, run in runs.items():
        if mechanism := of_a_run.drawings(run).get("mechanism"):
            drawn = mechanism()
            title = drawn.axes[0].title
            title.set_text(f"{plain(name)}: {title.get_text()}")
            yield _picture(f"mechanism, {name}", drawn)


def _picture(name: str, figure: Figure) -> str:
    data = base64.b64encode(encode(figure, "png", dpi=110)).decode()
    wide = ' class="wide"' if figure.get_figwidth() > WIDE else ""
    return f'<figure{wide}><img alt="{escape(name)}" src="data:image/png;base64,{data}"></figure>'


def _again(runs: Mapping[str, Results]) -> Iterator[str]:
    gives = "With the versions above it gives the same tables."
    if any(run.record.depends_on_a_clock for run in runs.values()):
        gives = "Tables of runs in real time, or of FMUs elsewhere, differ by when samples arrive."
    yield (
        "<p>Save a scene as <code>scene.toml</code>, then <code>hapticlink run scene.toml</code>. "
        f"{gives}</p>"
    )
    for name, run in runs.items():
        text = escape(scene_file(run))
        yield f"<details><summary>scene of {escape(name)}</summary><pre>{text}</pre></details>"
