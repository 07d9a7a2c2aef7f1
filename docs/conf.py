"""The documentation site, of the Markdown files in docs/ and results/:

pip install "hapticlink[docs]"
python docs/make_standalone.py  # minutes; without it the pages of scenes show pictures
sphinx-build -W -c docs . site

Then open site/index.html, from the disk or a server: search works in both, and no page fetches
anything from the network. Equations become MathML, which browsers show by themselves.
"""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = PROJECT["name"]
release = PROJECT["version"]
extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = ["docs/**", "results/**", "CHANGELOG.md"]
exclude_patterns = [
    ".*",
    "site",
    "standalone",
    "runs",
    "sweeps",
    "build",
    "dist",
    "tests",
    "benchmarks",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "hapticlink"
html_math_renderer = "mathml"
html_use_index = False
html_copy_source = False
html_show_copyright = False
FRAME = (
    r'<iframe src="\1" title="Drag the handle" style="width:100%;height:640px;border:0"></iframe>'
)
"""A scene that one can drag, in place of its picture."""
ALONE = r'<p>Drag the handle; <a href="\1">in a window of its own</a>.</p>'


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(convert(node.astext(), display="block"))
    raise nodes.SkipNode


def _front_page(app: Sphinx, error: Exception | None) -> None:
    """site/index.html leads to docs/index.html."""
    if error is None:
        to = json.dumps("0; url=docs/index.html")
        text = f"<!doctype html><title>hapticlink</title><meta http-equiv=refresh content={to}>"
        (Path(app.outdir) / "index.html").write_text(text, encoding="utf-8")


def _dragged(app: Sphinx, error: Exception | None) -> None:
    """The start page, and the page of each scene that has one, have the page in one file in place
    of their picture."""
    docs = Path(app.outdir) / "docs"
    if error or not (docs / "index.html").exists():
        return
    _replace(docs / "index.html", {
        r'<a [^>]*href="([^"]*closed_loop\.html)"><span[^>]*><img[^>]*></span></a>': FRAME,
        r'download="" (href="[^"]*closed_loop\.html")': r"\1",
    })  # fmt: skip
    for page in (docs / "scenes").glob("*.html"):
        file = Path(app.config.standalone) / page.name
        if file.exists():
            shutil.copy(file, page.with_name(f"drag-{page.name}"))
            framed = (FRAME + ALONE).replace(r"\1", f"drag-{page.name}")
            _replace(page, {r'<img alt="[^"]*, at the start"[^>]*>': framed})


def _replace(path: Path, by_pattern: dict[str, str]) -> None:
    text = path.read_text(encoding="utf-8")
    for pattern, replacement in by_pattern.items():
        text = re.sub(pattern, replacement, text)
    path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    app.add_config_value("standalone", str(ROOT / "standalone"), "")
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("build-finished", _front_page)
    app.connect("build-finished", _dragged)
