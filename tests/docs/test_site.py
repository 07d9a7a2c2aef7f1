"""The documentation site: built without a warning, and nothing fetched from the network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import ROOT

FETCHED = re.compile(r"""<(?:script|img|link|iframe)\b[^>]*?(?:src|href)=["']?(?:https?:)?//""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """By the command of docs/conf.py; links that lead nowhere are warnings too."""
    for needed in ("sphinx", "furo", "myst_parser", "latex2mathml"):
        pytest.importorskip(needed)
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-j", "2", "-c", "docs", "."]
    done = subprocess.run(
        [*command, str(out)], cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return out


def test_it_has_every_page_and_a_way_in(site: Path) -> None:
    assert "docs/index.html" in (site / "index.html").read_text(encoding="utf-8")
    pages = {p.relative_to(ROOT).with_suffix(".html") for p in ROOT.glob("docs/**/*.md")}
    pages |= {p.relative_to(ROOT).with_suffix(".html") for p in ROOT.glob("results/**/*.md")}
    assert [p for p in sorted(pages) if not (site / p).exists()] == []


def test_no_page_fetches_anything_from_the_network(site: Path) -> None:
    for path in site.rglob("*.html"):
        assert not FETCHED.search(path.read_text(encoding="utf-8")), path
    for path in site.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", path.read_text()), path


def test_equations_are_mathml(site: Path) -> None:
    text = (site / "docs" / "theory.html").read_text(encoding="utf-8")
    assert text.count("<math") > 10
    assert "$$" not in text
