"""An export says which rates other tools cannot step at the same instants."""

from __future__ import annotations

from pathlib import Path

import pytest

import hapticlink as hl


@pytest.mark.parametrize(
    ("rate", "said"), [(30, True), (64, False), ({"min": 20, "max": 40}, True)]
)
def test_rates_that_do_not_divide_the_haptic_one_are_told(
    tmp_path: Path, rate: object, said: bool, caplog: pytest.LogCaptureFixture
) -> None:
    hl.export("closed-loop", {"graphics.rate": rate}, out=tmp_path / "scene.ssp")
    assert ("a step of graphics is" in caplog.text) == said
    assert ("at other instants" in caplog.text) == said
