"""Where commands on studies and benchmarks find them, and what they say before they start."""

import sys
from pathlib import Path

import pytest

import hapticlink.components
from hapticlink.commands import checkout
from hapticlink.orchestrator.base.errors import InputFault
from tests.docs.pages import ROOT

FILES = {"components/x.py": "x = 1\n", "scenes/a.toml": "duration = 1\n", "__init__.py": "# face\n"}


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that was installed from a checkout, which is the current folder."""
    package, root = tmp_path / "site-packages" / "hapticlink", tmp_path / "checkout"
    for name, text in FILES.items():
        inside = name if "/" in name else f"package_root/{name}"
        for path in (package / name, root / inside):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    (root / "benchmarks").mkdir()
    (root / "benchmarks" / "__init__.py").touch()
    monkeypatch.setattr(hapticlink.components, "__path__", [str(package / "components")])
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(root)
    return package


def test_an_editable_install_is_its_own_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert checkout.folder("reproduce") == ROOT


def test_an_installed_package_takes_the_checkout_in_the_current_folder(installed: Path) -> None:
    (installed / "components" / "loop-1.so").write_text("compiled, not in the checkout")
    assert checkout.folder("reproduce") == Path.cwd()
    assert sys.path[0] == str(Path.cwd())


@pytest.mark.parametrize("name", FILES)
def test_another_state_than_the_installed_one_is_refused(installed: Path, name: str) -> None:
    (installed / name).write_text("older")
    with pytest.raises(InputFault, match=rf"\({name} differs\): `pip install \.` here first"):
        checkout.folder("reproduce")


def test_a_file_that_the_checkout_has_no_more_is_another_state(installed: Path) -> None:
    Path("components/x.py").unlink()
    with pytest.raises(InputFault, match=r"components/x\.py differs"):
        checkout.folder("reproduce")


def test_without_a_checkout_it_says_what_it_needs(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputFault, match=r"`hapticlink reproduce` needs a checkout .* its folder"):
        checkout.function("reproduce", "studies.report:reproduce")
    assert not [*tmp_path.glob("results*")]
