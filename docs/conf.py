"""The documentation site, of the Markdown files in docs/ and results/:

pip install "hapticlink[docs]"
sphinx-build -W -c docs . site

Then open site/index.html, from the disk or a server: search works in both, and no page fetches
anything from the network. Equations become MathML, which browsers show by themselves.
"""

from __future__ import annotations

import json
import re
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
exclude_patterns = [".*", "site", "runs", "sweeps", "build", "dist", "tests", "benchmarks"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "hapticlink"
html_math_renderer = "mathml"
html_use_index = False
html_copy_source = False
html_show_copyright = False
WITHIN = (
    r'<iframe src="\1" title="Drag the handle" style="width:100%;height:640px;border:0"></iframe>'
)


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
    """The start page has the page in one file in place of its picture, and opens it by its link."""
    path = Path(app.outdir) / "docs" / "index.html"
    if error is None and path.exists():
        text = re.sub(r'<a [^>]*href="([^"]*closed_loop\.html)"><span[^>]*><img[^>]*></span></a>',
                      WITHIN, path.read_text(encoding="utf-8"))  # fmt: skip
        text = re.sub(r'download="" (href="[^"]*closed_loop\.html")', r"\1", text)
        path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("build-finished", _front_page)
    app.connect("build-finished", _dragged)
