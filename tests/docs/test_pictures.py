"""Every shipped scene is shown in docs/mechanisms.md."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.image import imread

import hapticlink as hl
from tests.docs.pages import ROOT, blocks

FOLDER = ROOT / "docs" / "pictures"
PAGE = ROOT / "docs" / "mechanisms.md"


def test_every_scene_has_its_picture() -> None:
    """Those of the shipped scenes and of the page's example, and no others."""
    (example,) = (b.title.removesuffix(".toml") for b in blocks(PAGE, "toml") if b.title)
    shown = re.findall(r"\(pictures/([\w-]+)\.png\)", PAGE.read_text(encoding="utf-8"))
    assert sorted(shown) == sorted([*hl.shipped(), example])
    assert {p.name for p in FOLDER.iterdir()} == {f"{name}.png" for name in shown}


def test_pictures_are_small_and_not_empty() -> None:
    for path in FOLDER.iterdir():
        assert path.stat().st_size < 60_000, path
        assert np.ptp(imread(path)[..., :3]) > 0.9, path
