"""The registry of parts: names, suggestions for misspelt ones, and who registered them."""

import pytest

from hapticlink.components import registry
from hapticlink.components.registry import Registry, near


@pytest.fixture
def gears(monkeypatch):
    """A registry that is gone after the test."""
    monkeypatch.setattr(registry, "_REGISTRIES", [])
    return Registry("gear", {"first": 1, "reverse": -1})


def register(registered: Registry, name: str, part: object, module: str) -> None:
    """`registered.register(name, part)` as a line of `module`."""
    exec(
        "to.register(name, part)",
        {"__name__": module, "to": registered, "name": name, "part": part},
    )


def test_a_name_that_is_not_there(gears):
    assert gears.get("frist") is None
    with pytest.raises(ValueError, match="no gear 'frist'; did you mean 'first'"):
        gears["frist"]
    with pytest.raises(ValueError, match="no gear 'x'; there are first, reverse, or"):
        gears["x"]


def test_parts_of_a_plugin(gears):
    register(gears, "second", 2, "mine.gears")
    register(gears, "second", 2.1, "mine.gears")  # a cell of a notebook runs again
    register(gears, "third", 3, "__mp_main__")  # the main module in a process of a pool
    assert [*gears.items()] == [("first", 1), ("reverse", -1), ("second", 2.1), ("third", 3)]
    assert registry.origins() == registry.origins("gear") == ["__main__", "mine.gears"]
    assert registry.origins("hold") == []


@pytest.mark.parametrize(("name", "owner"), [("first", "hapticlink"), ("second", "mine")])
def test_a_name_that_is_taken(gears, name, owner):
    register(gears, "second", 2, "mine")
    with pytest.raises(ValueError, match=f"gear '{name}' is one of {owner}: take another name"):
        register(gears, name, 0, "yours")


def test_names_that_fit_are_read_when_they_are_asked_for(gears):
    forward = gears.names(lambda gear: gear > 0)
    gears.register("second", 2)
    assert [*forward] == ["first", "second"]
    assert forward.checked("second") == "second"
    with pytest.raises(ValueError, match="no gear 'reverse'; there are first, second"):
        forward.checked("reverse")


@pytest.mark.parametrize(
    ("name", "known", "hint"),
    [
        ("rod", ["ground", "wheel"], "there are ground, wheel"),
        ("bra", ["bar", "ground"], "did you mean 'bar'?"),
        ("controler", ["controller", "hand"], "did you mean 'controller'?"),
    ],
)
def test_a_hint_is_near(name, known, hint):
    """What may have been meant, and nothing far from it."""
    assert near(name, known) == hint
