"""Contacts that the hand does not feel are warned of, with the key that renders them."""

from __future__ import annotations

import pytest

import hapticlink as hl

SHORT = {"duration": 0.6}


def warned(options: dict[str, object]) -> list[str]:
    made = hl.run("obstacles", {**SHORT, **options})
    return [line for line in made.run["warnings"] if "controller.contact = true" in line]


def test_contacts_without_a_controller_that_renders_them() -> None:
    (line,) = warned({"controller.contact": False})
    assert "contacts act on the mechanism from 0." in line


@pytest.mark.parametrize(
    "options",
    [{}, {"controller.contact": False, "duration": 0.01}],
    ids=["rendered", "nothing is touched"],
)
def test_no_warning_without_cause(options: dict[str, object]) -> None:
    assert not warned(options)
