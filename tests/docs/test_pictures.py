"""Every shipped scene has a page with its picture; every page has pictures that are shown."""

import re

import numpy as np
import pytest
from matplotlib.image import imread

import hapticlink as hl
from docs import make_scenes
from tests.docs.pages import PAGES, ROOT, blocks, name, prose

DOCS = ROOT / "docs"
FOLDERS = [DOCS / "pictures", DOCS / "figures"]
IMAGE = re.compile(r"!\[.*?\]\((.+?)\)", re.DOTALL)
TEXT_ALONE = {
    "index.md",
    "api.md",
    "ports.md",
    "scene-reference.md",
    "glossary.md",
    "errata.md",
    "install.md",
}
"""Tables to look things up in."""


def test_the_pages_of_scenes_are_those_of_their_files() -> None:
    for path, text in make_scenes.pages().items():
        assert path.read_text(encoding="utf-8") == text, "run `python docs/make_scenes.py`"
    assert {p.stem for p in (DOCS / "scenes").iterdir()} == set(hl.shipped())


def test_every_scene_has_its_picture() -> None:
    """Those of the shipped scenes and of the linkages that pages describe, and no others."""
    pages = ("own-linkage.md", "scenes.md")
    examples = [b.title.removesuffix(".toml") for p in pages for b in blocks(DOCS / p, "toml")]
    wanted = sorted([*hl.shipped(), *filter(None, examples)])
    assert sorted(p.stem for p in FOLDERS[0].iterdir()) == wanted


def test_every_picture_is_shown_on_a_page() -> None:
    shown = {
        (page.parent / link).resolve() for page in PAGES for link in IMAGE.findall(prose(page))
    }
    assert [p.name for folder in FOLDERS for p in folder.iterdir() if p not in shown] == []


@pytest.mark.parametrize(
    "page", [p for p in PAGES if p.is_relative_to(DOCS) and p.name not in TEXT_ALONE], ids=name
)
def test_every_page_has_a_picture(page) -> None:
    assert IMAGE.search(prose(page))


def test_pictures_are_small_and_not_empty() -> None:
    for path in (p for folder in FOLDERS for p in folder.iterdir()):
        assert path.stat().st_size < 120_000, path
        if path.suffix != ".svg":  # whose content tests/test_rooms.py compares
            assert np.ptp(imread(path)[..., :3]) > 0.9, path
