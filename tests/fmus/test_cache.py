"""Built FMUs are found again, and never half of one."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from hapticlink.fmus import build, cache, cached
from tests.fmus import sample_components

MATERIAL = {"scene": {"mass": 1.0, "rates": [512, 30]}}


@pytest.fixture
def place(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Builder:
    """Counts how often it is asked."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, folder: Path) -> Path:
        self.calls += 1
        return build(sample_components.stateless(), folder)


def files(place: Path) -> list[str]:
    return [p.name for p in place.rglob("*") if p.is_file() or p.name.startswith(".")]


def test_built_once(place):
    builder = Builder()
    first, second = cached(MATERIAL, builder), cached(MATERIAL, builder)
    assert builder.calls == 1
    assert first == second
    assert first.is_relative_to(place)
    assert files(place) == ["gain.fmu"]


def test_order_of_keys_does_not_matter_but_values_do():
    assert cache.key({"a": 1, "b": 2.0}) == cache.key({"b": 2.0, "a": 1})
    assert cache.key({"a": 1}) != cache.key({"a": 2})


@pytest.mark.parametrize("name", cache.VERSIONS)
def test_versions_are_part_of_the_key(name, monkeypatch):
    before, version = cache.key(MATERIAL), cache.version
    monkeypatch.setattr(cache, "version", lambda n: "0.0" if n == name else version(n))
    assert cache.key(MATERIAL) != before


def test_sources_are_part_of_the_key(monkeypatch):
    before = cache.key(MATERIAL)
    monkeypatch.setattr(cache, "sources", lambda *packages: "other")
    assert cache.key(MATERIAL) != before


@pytest.mark.parametrize("damage", [b"", b"not a zip", None])
def test_a_damaged_file_is_built_again(place, damage):
    builder = Builder()
    path = cached(MATERIAL, builder)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0xFF
    path.write_bytes(bytes(flipped) if damage is None else damage)
    assert cached(MATERIAL, builder).read_bytes() == whole
    assert builder.calls == 2


def test_a_failed_build_leaves_nothing(place):
    def fail(folder: Path) -> Path:
        (folder / "half.fmu").write_bytes(b"half")
        raise RuntimeError("no")

    with pytest.raises(RuntimeError, match="no"):
        cached(MATERIAL, fail)
    assert files(place) == []


def test_what_a_killed_build_has_left_goes_with_the_next(place):
    """Not what another machine may still be at."""
    room = place / cache.key(MATERIAL)
    (room / ".dead").mkdir(parents=True)
    (room / ".dead" / "half.fmu").write_bytes(b"half")
    (room / ".half.fmu").write_bytes(b"half")
    for old in (room / ".dead", room / ".half.fmu"):
        os.utime(old, (0, 0))
    (room / ".fresh").mkdir()
    path = cached(MATERIAL, Builder())
    assert {p.name for p in room.iterdir()} == {path.name, ".fresh"}


def test_it_is_built_in_the_room_given(place, tmp_path):
    rooms = []

    def builder(folder: Path) -> Path:
        rooms.append(folder.parent)
        return build(sample_components.stateless(), folder)

    assert cached(MATERIAL, builder, tmp_path / "room").parent == place / cache.key(MATERIAL)
    assert rooms == [tmp_path / "room"]


def test_races_end_with_one_whole_file(place):
    paths, together = [], threading.Barrier(4)

    def race() -> None:
        def builder(folder: Path) -> Path:
            together.wait(timeout=30)  # all found the cache empty
            return build(sample_components.stateless(), folder)

        paths.append(cached(MATERIAL, builder))

    threads = [threading.Thread(target=race) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(paths)) == 1
    assert files(place) == ["gain.fmu"]


def test_off_builds_every_time_and_keeps_nothing(monkeypatch, tmp_path):
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    builder = Builder()
    assert cached(MATERIAL, builder) != cached(MATERIAL, builder)
    assert builder.calls == 2
    assert cache.folder() is None


def test_the_users_own_folder_by_default(monkeypatch, tmp_path):
    monkeypatch.delenv("HAPTICLINK_CACHE", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.folder() == tmp_path / "hapticlink"
