"""Platforms that the loop is compiled for: each wheel has one library."""

import pytest
from packaging.tags import sys_tags

from hapticlink.fmus.native.compiler_cache import linker_cache
from hapticlink.orchestrator.run.compiled import build


def test_pip_takes_the_wheel_of_this_machine():
    tag = build.this_machine()
    if tag is None:
        pytest.skip("no wheels are made for this platform")
    assert tag in {each.platform for each in sys_tags()}


@pytest.mark.parametrize(
    ("tag", "magic"),
    [("win_amd64", b"MZ"), ("manylinux_2_17_aarch64", b"\x7fELF\x02\x01")],
)
def test_the_loop_compiles_for_another_platform(tag, magic, tmp_path, monkeypatch):
    """With the C library for Windows that other tests of this run link with: zig takes a minute to
    build it."""
    pytest.importorskip("ziglang", reason="cross-compiling needs ziglang")
    library = tmp_path / build.name(tag)
    with linker_cache(build.WHEELS[tag]) as environment:
        for name, folder in environment.items():
            monkeypatch.setenv(name, folder)
        build.compile_loop(library, build.zig(tag))
    content = library.read_bytes()
    assert content.startswith(magic)
    assert b"hapticlink_events" in content


def test_an_unknown_platform_is_an_error():
    with pytest.raises(KeyError, match="win32"):
        build.zig("win32")
