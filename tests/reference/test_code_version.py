"""Which tables are those of the code that is there."""

import json
from pathlib import Path

import pytest

from benchmarks import code_version


def test_tables_are_current_until_a_package_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "README.md"
    page.write_text("# Masters\n")
    code_version.sign(tmp_path, "master", page)
    commit = json.loads((tmp_path / code_version.MADE_FROM).read_text())["master"]["commit"]
    assert page.read_text() == f"# Masters\n\nMade from commit {commit}.\n"
    assert [*code_version.status(tmp_path, ["master", "skip"])] == [
        f"master: made from {commit}: current",
        "skip: made from a commit that is not recorded",
    ]
    hashes = code_version._hashes()
    monkeypatch.setattr(code_version, "_hashes", lambda: hashes | {"orchestrator": "other"})
    assert [*code_version.status(tmp_path, ["master"])] == [
        f"master: made from {commit}, since when orchestrator changed"
    ]
