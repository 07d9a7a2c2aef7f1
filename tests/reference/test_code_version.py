"""Which tables are those of the code that is there."""

import json
from pathlib import Path
from types import ModuleType

import pytest

import hapticlink.scenes
from benchmarks import code_version
from hapticlink.fmus.cache import sources


def test_tables_are_current_until_a_package_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "README.md"
    page.write_text("# Masters\n")
    code_version.sign(tmp_path, "master", page)
    commit = json.loads((tmp_path / code_version.MADE_FROM).read_text())["master"]["commit"]
    assert page.read_text() == f"# Masters\n\nMade from commit {commit}.\n"
    pages = {"master": page, "skip": tmp_path / "skip.md"}
    current, unknown = code_version.status(tmp_path, pages)
    assert current == f"master: made from commit {commit}, current"
    assert unknown.startswith("skip: made from commit unknown; changed since then: components, ")
    hashes = code_version._hashes()
    monkeypatch.setattr(code_version, "_hashes", lambda: hashes | {"orchestrator": "other"})
    page.write_text(page.read_text() + "\nThe finding.\n")
    for _ in range(2):
        (told,) = code_version.status(tmp_path, {"master": page})
        assert told == f"master: made from commit {commit}; changed since then: orchestrator"
        assert [*code_version.stale(tmp_path, pages)] == [told]
    made = f"Made from commit {commit}; changed since then: orchestrator."
    assert page.read_text() == f"# Masters\n\n{made}\n\nThe finding.\n"


def test_a_scene_is_a_source_of_tables(tmp_path: Path) -> None:
    scenes = ModuleType("scenes")
    scenes.__path__ = [str(tmp_path)]
    hashes = []
    for rate in (512, 512, 1000):
        (tmp_path / "scene.toml").write_text(f"haptics.rate = {rate}\n")
        hashes.append(sources.__wrapped__(scenes))
    assert hashes[0] == hashes[1] != hashes[2]
    assert hapticlink.scenes in code_version.MEASURED
