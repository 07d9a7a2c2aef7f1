"""Platforms that the loop is compiled for: each wheel has one library."""

import subprocess
from pathlib import Path

import pytest
from packaging.tags import sys_tags

from hapticlink.orchestrator.run.compiled import build
from tests.programs import windows


def test_pip_takes_the_wheel_of_this_machine() -> None:
    tag = build.this_machine()
    if tag is None:
        pytest.skip("no wheels are made for this platform")
    assert tag in {each.platform for each in sys_tags()}


@pytest.mark.parametrize(
    ("tag", "magic"),
    [("win_amd64", b"MZ"), ("manylinux_2_17_aarch64", b"\x7fELF\x02\x01")],
)
def test_the_loop_compiles_for_another_platform(tag: str, magic: bytes, tmp_path: Path) -> None:
    pytest.importorskip("ziglang", reason="cross-compiling needs ziglang")
    library = tmp_path / build.name(tag)
    build.compile_loop(library, build.zig(tag))
    content = library.read_bytes()
    assert content.startswith(magic)
    assert b"hapticlink_events" in content


WAITING = """
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
int64_t hapticlink_now(void);
void hapticlink_wait(int64_t), hapticlink_guard(int);
int main(int argc, char **argv) {
    const int64_t until = hapticlink_now() + 20000000;
    hapticlink_wait(until);
    printf("%d", hapticlink_now() >= until);
    hapticlink_guard(1);
    exit(0);
}
"""


@pytest.mark.skipif(not windows.WINE, reason="no wine64")
def test_the_loop_for_windows_waits_and_guards_the_exit(tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text(WAITING)
    library = tmp_path / build.name("win_amd64")
    build.compile_loop(library, build.zig("win_amd64"))
    done = subprocess.run(
        windows.program(tmp_path / "main.c", library),
        cwd=tmp_path, env=windows.environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "1"
    assert done.returncode == 1  # a run was going on


def test_an_unknown_platform_is_an_error() -> None:
    with pytest.raises(KeyError, match="win32"):
        build.zig("win32")
