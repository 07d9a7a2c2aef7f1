"""What run.json says of hapticlink's own code."""

import hashlib
import shutil
import subprocess
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import pytest

from hapticlink.fmus import versions


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file as that of another installation, in a folder of its own."""
    file = tmp_path / "fmus" / "versions.py"
    file.parent.mkdir()
    shutil.copy(versions.__file__, file)
    monkeypatch.setattr(versions, "__file__", str(file))
    return tmp_path


def git(folder: Path, *arguments: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    command = ["git", *who, *arguments]
    return subprocess.check_output(command, cwd=folder, text=True).strip()


@pytest.mark.skipif(not shutil.which("git"), reason="git is not installed")
def test_a_checkout_has_its_commit_and_says_what_differs(copied: Path) -> None:
    git(copied, "init", "-q")
    git(copied, "add", ".")
    git(copied, "commit", "-q", "-m", "first")
    git(copied, "tag", "v1")
    commit = git(copied, "rev-parse", "HEAD")
    found = versions.find_code.__wrapped__
    assert found() == {"commit": commit}
    (copied / "fmus" / "versions.py").write_text("")
    assert found() == {"commit": f"{commit}-dirty"}


def test_a_wheel_has_the_hash_of_its_record(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def distribution(name: str) -> SimpleNamespace:
        assert name == "hapticlink"
        return SimpleNamespace(read_text={"RECORD": "hapticlink/__init__.py,sha256=x,3\n"}.get)

    monkeypatch.setattr(metadata, "distribution", distribution)
    expected = hashlib.sha256(b"hapticlink/__init__.py,sha256=x,3\n").hexdigest()
    assert versions.find_code.__wrapped__() == {"wheel": f"sha256:{expected}"}
    assert copied.exists()


def test_a_copy_without_either_says_nothing(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        metadata, "distribution", lambda _: SimpleNamespace(read_text=lambda _: None)
    )
    assert versions.find_code.__wrapped__() == {}
    assert copied.exists()
