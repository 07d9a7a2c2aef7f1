"""Files made from a scene, and what would run, from Python."""

from __future__ import annotations

from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.orchestrator.scene import find


def test_build_gives_the_file_of_each_block(bar: Path, tmp_path: Path) -> None:
    made = hl.build(bar, {"duration": 1.0}, out=tmp_path / "fmus")
    assert made == {"virtual_mechanism": tmp_path / "fmus" / "virtual_mechanism.fmu"}
    assert made["virtual_mechanism"].is_file()
    with pytest.raises(hl.InputFault, match="packaging=native"):
        hl.build(bar, out=tmp_path, all_platforms=True)


def test_an_exported_scene_explains_itself_as_the_scene_does(bar: Path, tmp_path: Path) -> None:
    path = hl.export(hl.scene(bar), {"haptics.rate": 100}, out=tmp_path / "bar.ssp")
    assert path == tmp_path / "bar.ssp"
    assert hl.explain(path) == hl.explain(bar, {"haptics.rate": 100})
    assert hl.explain(bar) != hl.explain(path)


def test_the_shipped_scenes_have_titles() -> None:
    assert hl.shipped()["closed-loop"] == hl.scene("closed-loop").title
    assert list(hl.shipped()) == list(find.shipped())
