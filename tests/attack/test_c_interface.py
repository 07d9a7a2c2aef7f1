"""The attack on the C interface, in short."""

from collections.abc import Callable
from pathlib import Path

import pytest

from hapticlink.components.component import Component
from hapticlink.fmus.native.native_fmu_entries import WRAPPER
from tests.attack.c_interface import Fmu, called, can_sanitize, native, python, sanitized, trapped
from tests.attack.cases import counted, total
from tests.fmus import sample_components

with_gcc = pytest.mark.skipif(not can_sanitize(), reason="no gcc with a library for addresses")


@pytest.mark.parametrize("make", [native, trapped, pytest.param(sanitized, marks=with_gcc), python])
def test_every_call_returns(
    tmp_path: Path, make: Callable[[Component, Path], Fmu], capsys: pytest.CaptureFixture[str]
) -> None:
    made = make(sample_components.controller(), tmp_path)
    counts = total(counted(called(made, 2000, 7, tmp_path)))
    assert counts == {"returned": 2000}, capsys.readouterr().err


BEYOND = ("is_unknown(m, vr[i], REALS)", "is_unknown(m, vr[i], REALS + 1)")
SHORT = ("size < sizeof(State)", "size < 8")


@pytest.mark.parametrize(
    ("make", "good", "bad"),
    [
        (trapped, *BEYOND),
        pytest.param(sanitized, *BEYOND, marks=with_gcc),
        pytest.param(sanitized, *SHORT, marks=with_gcc),
    ],
)
def test_the_attack_finds_what_is_wrong(
    tmp_path: Path, make: Callable[[Component, Path, Path], Fmu], good: str, bad: str
) -> None:
    text = WRAPPER.read_text()
    assert good in text
    (tmp_path / "broken.c").write_text(text.replace(good, bad))
    broken = make(sample_components.controller(), tmp_path, tmp_path / "broken.c")
    assert total(counted(called(broken, 4000, 7, tmp_path)))["crashed"]
