"""The documentation site: built without a warning, and nothing fetched from the network."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs import make_standalone
from tests.docs.pages import ROOT

FETCHED = re.compile(r"""<(?:script|img|link|iframe)\b[^>]*?(?:src|href)=["']?(?:https?:)?//""")


DRAGGED = ("pendulum", "four-bar")
"""Scenes that have their page in one file."""


@pytest.fixture(scope="module")
def standalone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("standalone")
    assert make_standalone.main(DRAGGED, folder) == [*DRAGGED]
    return folder


@pytest.fixture(scope="module")
def site(standalone: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """By the command of docs/conf.py; links that lead nowhere are warnings too."""
    for needed in ("sphinx", "furo", "myst_parser", "latex2mathml"):
        pytest.importorskip(needed)
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-j", "2", "-c", "docs"]
    command += ["-D", f"standalone={standalone}", "."]
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


def test_scenes_that_have_their_page_in_one_file_show_it(site: Path) -> None:
    framed = re.compile(r'<iframe src="(.+?)"')
    for path in (site / "docs" / "scenes").glob("*.html"):
        if path.name.startswith("drag-"):
            continue
        files = framed.findall(path.read_text(encoding="utf-8"))
        assert files == ([f"drag-{path.name}"] if path.stem in DRAGGED else []), path
        assert all((path.parent / file).stat().st_size < 400_000 for file in files)


def test_pages_are_made_again_where_their_scene_or_sources_are_others(
    standalone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert make_standalone.main(DRAGGED, standalone) == []
    (standalone / "four-bar.html").unlink()
    assert make_standalone.main(DRAGGED, standalone) == ["four-bar"]
    monkeypatch.setattr(make_standalone.one_file, "bundle", lambda name: "// another")
    assert make_standalone.main(["pendulum"], standalone) == ["pendulum"]


def test_a_scene_that_cannot_become_a_page_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert make_standalone.main(["scenario"], tmp_path) == []
    assert "at[0]: what happens at given times" in capsys.readouterr().out
    assert not [*tmp_path.glob("*.html")]
