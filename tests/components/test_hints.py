"""Hints name what may have been meant, and nothing far from it."""

from __future__ import annotations

import pytest

from hapticlink.components.registry import near


@pytest.mark.parametrize(
    ("name", "known", "hint"),
    [
        ("rod", ["ground", "wheel"], "there are ground, wheel"),
        ("bra", ["bar", "ground"], "did you mean 'bar'?"),
        ("controler", ["controller", "hand"], "did you mean 'controller'?"),
    ],
)
def test_a_hint_is_near(name: str, known: list[str], hint: str) -> None:
    assert near(name, known) == hint
