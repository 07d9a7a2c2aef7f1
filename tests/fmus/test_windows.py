"""Libraries for Windows, linked with the C functions of Windows alone, under wine."""

import subprocess
from pathlib import Path

import pytest

from hapticlink.fmus.native.compiler import compile_library
from tests.programs import windows

pytestmark = pytest.mark.skipif(not windows.WINE, reason="no wine64")
LIBRARY = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#define SHOWN __declspec(dllexport)
static int constructed;
__attribute__((constructor)) static void begun(void) { constructed = 7; }
static void ended(void) { puts("ended"), fflush(NULL); }
SHOWN int value(void) { return atexit(ended) ? -1 : constructed; }
SHOWN int kind(double x) { return isnan(x) ? 0 : isinf(x) ? 1 : isfinite(x) + fpclassify(x); }
SHOWN int written(char *text, int size, double x) { return snprintf(text, size, "%.17g", x); }
SHOWN int large(int n) {
    volatile char bytes[300000];
    bytes[n] = 5; /* further from the stack's end than the page that Windows adds */
    return bytes[n];
}
"""
MAIN = """
#include <math.h>
#include <stdio.h>
int value(void), kind(double), written(char *, int, double), large(int);
int main(int argc, char **argv) {
    char text[8];
    const int length = written(text, sizeof text, 0.1);
    printf("%d %d %s %d", value(), length, text, large(7));
    printf(" %d %d %d", kind(NAN), kind(-INFINITY), kind(5e-324) == 1 + FP_SUBNORMAL);
    printf(" %d %d\\n", kind(0.0) == 1 + FP_ZERO, kind(1.0) == 1 + FP_NORMAL);
    return 3;
}
"""


def test_windows_has_the_functions_of_c(tmp_path: Path) -> None:
    (tmp_path / "own.c").write_text(LIBRARY)
    (tmp_path / "main.c").write_text(MAIN)
    library = compile_library(tmp_path / "own.c", tmp_path / "library.dll", "win64")
    assert library.stat().st_size < 20_000  # nothing of zig's own library
    done = subprocess.run(
        windows.program(tmp_path / "main.c", library),
        cwd=tmp_path, env=windows.environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.splitlines() == ["7 19 0.10000 5 0 1 1 1 1", "ended"]
    assert done.returncode == 3
