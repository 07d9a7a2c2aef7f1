"""Parts by name: the one place that says which integrators, forces, blocks, holds there are."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Part = TypeVar("Part")

_REGISTRIES: list[Registry[Any]] = []


class Registry(dict[str, Part]):
    """The parts of one kind ("hold") by the names that a scene gives them.

    The package's own stand where the registry is made, one a line; those of a plugin come by
    `register`. A name that is not there is a ValueError with what is near it.
    """

    def __init__(self, kind: str, parts: Mapping[str, Part]) -> None:
        super().__init__(parts)
        self.kind = kind
        self.origins: dict[str, str] = {}
        """By name, the module that has registered it."""
        _REGISTRIES.append(self)

    def register(self, name: str, part: Part) -> None:
        """Add a part. Raises ValueError for a name that another module has given away."""
        # A process of a pool runs the main module under another name.
        module = str(sys._getframe(1).f_globals["__name__"]).replace("__mp_main__", "__main__")
        if name in self and self.origins.get(name) != module:
            owner = self.origins.get(name, "hapticlink")
            raise ValueError(f"{self.kind} {name!r} is one of {owner}: take another name")
        self[name] = part
        self.origins[name] = module

    def __missing__(self, name: str) -> Part:
        raise ValueError(self.unknown(name))

    def unknown(self, name: str, among: Iterable[str] | None = None) -> str:
        """That no part has this name, or none of those `among` which one is to be chosen."""
        said = unknown(self.kind, name, self if among is None else among)
        return said if "did you mean" in said else f"{said}, or those of a plugin"

    def names(self, fits: Callable[[Part], bool] = lambda part: True) -> Names[Part]:
        """The names of the parts that fit, for `Annotated[str, ...]` of a scene's key."""
        return Names(self, fits)


@dataclass(frozen=True, eq=False)
class Names(Generic[Part]):
    """Names that a key of a scene may have, as they are when the scene is read."""

    registry: Registry[Part]
    fits: Callable[[Part], bool]

    def __iter__(self) -> Iterator[str]:
        if not self.registry:
            raise RuntimeError(f"no {self.registry.kind} is registered yet: import its room first")
        return (name for name, part in self.registry.items() if self.fits(part))

    def checked(self, name: str) -> str:
        """`name`. Raises ValueError where it is none of these."""
        if name not in tuple(self):
            raise ValueError(self.registry.unknown(name, self))
        return name

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        """What pydantic, which reads scenes, asks of an annotation."""
        from pydantic_core import core_schema  # of no use to components by themselves

        return core_schema.no_info_after_validator_function(self.checked, handler(source))


def origins(*kinds: str) -> list[str]:
    """The modules that have registered parts, of `kinds` or of any, sorted."""
    chosen = (r for r in _REGISTRIES if not kinds or r.kind in kinds)
    return sorted({module for registry in chosen for module in registry.origins.values()})


MOST = 100
"""Names that are searched for one that is near, and shown where none is."""


def near(name: str, known: Iterable[str]) -> str:
    """The nearest of what there is, or all of it."""
    known = list(known)
    found = difflib.get_close_matches(name[:MOST], known[:MOST], 1)
    more = f" and {len(known) - MOST} more" if len(known) > MOST else ""
    there = ", ".join(each[:MOST] for each in known[:MOST]) or "none"
    return f"did you mean {found[0]!r}?" if found else f"there are {there}{more}"


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """That there is no `kind` of this name, with the nearest that there is."""
    shown = repr(name) if len(name) <= MOST else f"{name[:MOST]!r}..."
    return f"no {kind} {shown}; {near(name, known)}"
