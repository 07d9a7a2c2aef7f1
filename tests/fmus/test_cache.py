"""Built FMUs are found again, and never half of one."""

from __future__ import annotations

import os
import sys
import threading
import time
import zipfile
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import NoReturn

import pytest

import hapticlink as hl
from hapticlink.fmus import cache, durations, lock
from hapticlink.fmus.build_fmu import build
from hapticlink.fmus.cache import get_or_build
from hapticlink.fmus.check import check_fmu
from hapticlink.fmus.native import compiler
from hapticlink.orchestrator.fmi import load_library
from tests.fmus import sample_components

MATERIAL = {"scene": {"mass": 1.0, "rates": [512, 30]}}


@pytest.fixture
def place(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def room(tmp_path) -> Path:
    return tmp_path / "room"


class Builder:
    """Counts how often it is asked."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, folder: Path) -> Path:
        self.calls += 1
        return build(sample_components.stateless(), folder)


def files(place: Path) -> list[str]:
    return sorted(p.name for p in place.rglob("*") if p.is_file() or p.name.startswith("."))


def test_built_once(place, room):
    builder = Builder()
    first, second = get_or_build(MATERIAL, builder, room), get_or_build(MATERIAL, builder, room)
    assert builder.calls == 1
    assert first == second
    assert first.is_relative_to(place)
    assert files(place) == [".gain.fmu.sha256", "gain.fmu"]


def test_an_archive_without_a_model_is_built_once(place, room):
    """As that of a page's program."""
    calls = []

    def build(folder: Path) -> Path:
        calls.append(folder)
        with zipfile.ZipFile(folder / "page.fmu", "w") as archive:
            archive.writestr("page.wasm", b"module")
        return folder / "page.fmu"

    assert get_or_build(MATERIAL, build, room) == get_or_build(MATERIAL, build, room)
    assert len(calls) == 1


def test_order_of_keys_does_not_matter_but_values_do():
    assert cache.key({"a": 1, "b": 2.0}) == cache.key({"b": 2.0, "a": 1})
    assert cache.key({"a": 1}) != cache.key({"a": 2})


@pytest.mark.parametrize("name", cache.VERSIONS)
def test_versions_are_part_of_the_key(name, monkeypatch):
    before, found = cache.key(MATERIAL), cache.find_versions
    monkeypatch.setattr(cache, "find_versions", lambda names: found(names) | {name: "0.0"})
    assert cache.key(MATERIAL) != before


def test_sources_are_part_of_the_key(monkeypatch):
    before = cache.key(MATERIAL)
    monkeypatch.setattr(cache, "sources", lambda *packages: "other")
    assert cache.key(MATERIAL) != before


@pytest.mark.parametrize("damage", [b"", b"not a zip", None])
def test_a_damaged_file_is_built_again(place, room, damage):
    builder = Builder()
    path = get_or_build(MATERIAL, builder, room)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0xFF
    path.write_bytes(bytes(flipped) if damage is None else damage)
    assert get_or_build(MATERIAL, builder, room).read_bytes() == whole
    assert builder.calls == 2


def test_any_other_byte_is_seen_in_a_file_of_the_cache(place, room):
    """Also one that no checksum of an archive covers."""
    builder = Builder()
    path = get_or_build(MATERIAL, builder, room)
    whole = path.read_bytes()
    path.write_bytes(whole + b"\0")
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
    assert get_or_build(MATERIAL, builder, room).read_bytes() == whole
    cache.forget(path)
    assert not path.parent.exists()


def test_a_failed_build_leaves_nothing(place, room):
    def fail(folder: Path) -> Path:
        (folder / "half.fmu").write_bytes(b"half")
        raise RuntimeError("no")

    with pytest.raises(RuntimeError, match="no"):
        get_or_build(MATERIAL, fail, room)
    assert files(place) == []


def test_what_a_killed_copy_has_left_goes_with_the_next_build(place, room):
    """Of another FMU too; not what another machine may still be at."""
    place.mkdir()
    for name in (".half", ".fresh"):
        (place / name).write_bytes(b"half")
    os.utime(place / ".half", (0, 0))
    get_or_build(MATERIAL, Builder(), room)
    assert files(place) == [".fresh", ".gain.fmu.sha256", "gain.fmu"]


def test_a_killed_build_leaves_nothing_in_the_cache(place, room):
    """It is built elsewhere, and copied before it has its place."""
    seen = []

    def builder(folder: Path) -> Path:
        seen.append(folder.parent)
        assert [path.name for path in place.iterdir()] == ["locks"]
        return build(sample_components.stateless(), folder)

    assert get_or_build(MATERIAL, builder, room).parent == place / cache.key(MATERIAL)
    assert seen == [room]
    assert list(room.iterdir()) == []


def test_a_cache_that_cannot_be_written_is_told_and_done_without(place, room, caplog):
    place.write_text("a file where the cache should be")
    path = get_or_build(MATERIAL, Builder(), room)
    assert path.is_relative_to(room)
    assert check_fmu(path) == []
    assert f"the cache {place} cannot be used" in caplog.text


def test_processes_of_two_machines_end_with_one_whole_file(place, room, monkeypatch):
    """Their locks do not see each other."""
    monkeypatch.setattr(cache, "exclusively", lambda *_: nullcontext())
    paths, together = [], threading.Barrier(4)

    def race() -> None:
        def builder(folder: Path) -> Path:
            together.wait(timeout=30)  # all found the cache empty
            return build(sample_components.stateless(), folder)

        paths.append(get_or_build(MATERIAL, builder, room))

    threads = [threading.Thread(target=race) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(paths)) == 1
    assert files(place) == [".gain.fmu.sha256", "gain.fmu"]


class Elsewhere(set):
    """Locks that another process holds."""

    def __contains__(self, lock):
        return False


@pytest.mark.parametrize("held", [set(), Elsewhere()])
def test_who_needs_the_same_fmu_waits_for_it_and_tells_of_another_process(
    place, room, caplog, monkeypatch, held
):
    monkeypatch.setattr(cache, "_held", held)
    builder, polled = Builder(), []

    def slow(folder: Path) -> Path:
        other.start()
        while not polled:  # it waits
            time.sleep(0.001)
        return builder(folder)

    def wait() -> None:
        paths.append(get_or_build({"block": "gain"}, builder, room, lambda: polled.append(True)))

    paths: list[Path] = []
    other = threading.Thread(target=wait)
    paths.append(get_or_build({"block": "gain"}, slow, room))
    other.join()
    assert builder.calls == 1
    assert paths[0] == paths[1]
    told = ["waiting for another process that builds gain"]
    assert caplog.messages == (told if isinstance(held, Elsewhere) else [])


def test_whoever_waits_can_be_interrupted(place, room):
    def interrupted() -> None:
        raise KeyboardInterrupt

    def build(folder: Path) -> Path:
        return get_or_build(MATERIAL, Builder(), room, interrupted)  # waits for this very build

    with pytest.raises(KeyboardInterrupt):
        get_or_build(MATERIAL, build, room)
    assert get_or_build(MATERIAL, Builder(), room).exists()


def test_a_process_that_ends_at_once_removes_its_locks(place, room):
    found = []

    def ended(folder: Path) -> Path:
        found.append(len([*(place / "locks").iterdir()]))
        cache.remove_locks()
        found.append(len([*(place / "locks").iterdir()]))
        return Builder()(folder)

    get_or_build(MATERIAL, ended, room)
    assert found == [1, 0]


def test_off_builds_every_time_and_keeps_nothing(monkeypatch, room):
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    builder = Builder()
    assert get_or_build(MATERIAL, builder, room) != get_or_build(MATERIAL, builder, room)
    assert builder.calls == 2
    assert cache.folder() is None


def test_the_users_own_folder_by_default(monkeypatch, tmp_path):
    monkeypatch.delenv("HAPTICLINK_CACHE", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.folder() == tmp_path / "hapticlink"


@pytest.mark.skipif(sys.platform == "win32", reason="has no modes")
def test_locks_and_libraries_lie_where_no_other_user_gets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not at predictable names in a temporary folder, which another user may hold or link."""
    root = tmp_path / "home" / "cache"
    monkeypatch.setenv("HAPTICLINK_CACHE", str(root))
    seen: list[Path] = []
    attempted = lock.try_lock

    def noted(path: Path) -> AbstractContextManager[bool]:
        if not path.is_dir():  # a run locks its own folder, without a file
            seen.append(path)
        return attempted(path)

    monkeypatch.setattr(lock, "try_lock", noted)
    hl.run("pendulum", {"duration": 0.02})
    assert seen
    assert all(path.parent == root / "locks" for path in seen)
    for folder in (root, root / "locks", root / "libraries"):
        assert folder.stat().st_mode & 0o777 == 0o700
    assert not [*(root / "locks").iterdir()]


@pytest.mark.skipif(os.name != "posix", reason="owners and modes of Unix")
@pytest.mark.parametrize("others", ["mode", "owner"])
def test_a_cache_that_others_can_write_is_not_used(place, room, monkeypatch, caplog, others):
    """What lies in it is run as code. It is told once."""
    get_or_build(MATERIAL, Builder(), room)
    if others == "mode":
        place.chmod(0o777)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
        monkeypatch.setattr(cache, "_is_of_user", lambda status: status.st_uid == os.geteuid())
    builder = Builder()
    for _ in range(2):
        assert get_or_build(MATERIAL, builder, room).is_relative_to(room)
    assert builder.calls == 2
    assert caplog.text.count("is not used, since") == 1


@pytest.mark.skipif(os.name != "posix" or os.geteuid(), reason="only root gives files away")
def test_a_file_of_another_user_in_the_cache_is_built_again(place, room):
    builder = Builder()
    path = get_or_build(MATERIAL, builder, room)
    os.chown(path, 12345, 12345)
    assert get_or_build(MATERIAL, builder, room) == path
    assert builder.calls == 2
    assert path.stat().st_uid == 0


def unreadable(*_: object) -> NoReturn:
    raise PermissionError(13, "Permission denied")


def test_a_cache_that_cannot_be_read_is_passed_by(place, room, monkeypatch, caplog):
    monkeypatch.setattr(cache, "is_whole", unreadable)
    get_or_build(MATERIAL, Builder(), room)
    monkeypatch.setattr(cache, "private", unreadable)
    assert get_or_build(MATERIAL, Builder(), room).is_relative_to(room)
    assert "cannot be used (Permission denied): gain.fmu is not kept" in caplog.text


@pytest.mark.skipif(os.name != "posix", reason="pipes are files of Unix")
def test_a_pipe_in_the_cache_is_not_waited_for(place, room):
    path = get_or_build(MATERIAL, Builder(), room)
    path.unlink()
    os.mkfifo(path)
    assert get_or_build(MATERIAL, Builder(), room) == path
    assert path.is_file()


@pytest.mark.parametrize("text", ["[]", '{"this": "long"}', "{", "\0"])
def test_durations_that_are_damaged_are_not_known(place, text):
    place.mkdir()
    (place / durations.FILE).write_text(text)
    with durations.record_duration("this") as took:
        assert took is None


def test_durations_need_no_cache(place, monkeypatch):
    monkeypatch.setattr(cache, "private", unreadable)
    with durations.record_duration("this") as took:
        assert took is None


def test_a_library_of_python_fmus_needs_no_room_in_the_cache(place, monkeypatch):
    """Where the cache is full it lies in a folder of this process."""
    real, full = load_library._write, []

    def write(path: Path, content: bytes) -> None:
        if path.is_relative_to(place):
            full.append(path)
            raise OSError(28, "No space left on device")
        real(path, content)

    monkeypatch.setattr(load_library, "_write", write)
    stored = load_library._store(b"a library", "0" * 64)
    assert stored.read_bytes() == b"a library"
    assert full


@pytest.mark.parametrize("cached", [True, False])
def test_the_linker_has_a_cache_where_the_home_is_read_only(tmp_path, monkeypatch, cached):
    """In the folder of HAPTICLINK_CACHE, else for this once."""
    monkeypatch.delenv(compiler.ZIG_CACHE, raising=False)
    home, own = tmp_path / "home", tmp_path / "own"
    home.write_text("a file, in which nothing can be made")
    monkeypatch.setattr(cache, "user_folder", lambda: home / "hapticlink")
    monkeypatch.setenv("HAPTICLINK_CACHE", str(own) if cached else "off")
    with compiler.linker_cache("here") as chosen:
        folder = Path(chosen[compiler.ZIG_CACHE])
        assert folder.is_relative_to(own) == cached
        (folder / "inside").mkdir(parents=True)
    assert folder.exists() == cached
