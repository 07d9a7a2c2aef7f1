"""The key of a sweep's rows: another with any source that computes a row, and with no other."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import hapticlink.analysis
import hapticlink.components
import hapticlink.fmus
import hapticlink.orchestrator
import hapticlink.visualization
from hapticlink.analysis.sweep import job
from hapticlink.fmus import cache
from hapticlink.orchestrator import open_scene

PACKAGES = (
    hapticlink.components,
    hapticlink.fmus,
    hapticlink.orchestrator,
    hapticlink.analysis,
    hapticlink.visualization,
)


@pytest.fixture
def key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], str]:
    """The key of a scene's row, as the sources of a copy of the packages in `tmp_path` have it."""
    for package in PACKAGES:
        name = package.__name__.rpartition(".")[2]
        shutil.copytree(next(iter(package.__path__)), tmp_path / name)
        monkeypatch.setattr(package, "__path__", [str(tmp_path / name)])
    scene = open_scene.load("pendulum", ())

    def asked() -> str:
        cache.sources.cache_clear()
        job._list_code.cache_clear()
        return job.key(scene)

    return asked


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    yield
    cache.sources.cache_clear()
    job._list_code.cache_clear()


@pytest.mark.parametrize(
    ("file", "other"),
    [
        ("orchestrator/run/compiled/operations.c", True),
        ("orchestrator/run/compiled/holds.c", True),
        ("orchestrator/run/compiled/loop.h", True),
        ("fmus/native/fmi2.c", True),
        ("components/component.py", True),
        ("analysis/sweep/row.py", True),
        ("visualization/figure_axes.py", False),
        ("visualization/live_page/server.py", False),
    ],
)
def test_a_changed_byte_changes_the_key_of_what_computes_a_row(
    tmp_path: Path, key: Callable[[], str], file: str, other: bool
) -> None:
    before = key()
    assert key() == before
    source = tmp_path / file
    content = bytearray(source.read_bytes())
    content[0] ^= 1
    source.write_bytes(content)
    assert (key() != before) == other
