"""Registries: integrators, forces, blocks, holds and other parts by name."""

from __future__ import annotations

import difflib
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Part = TypeVar("Part")

_REGISTRIES: list[Registry[Any]] = []


class Registry(dict[str, Part]):
    """The parts of one kind ("hold") by the names that a scene uses.

    The package's own parts are listed where the registry is created; those of plugins are added by
    `register`. Looking up an unknown name raises ValueError with the nearest known one. misfit: why
    a part cannot be one of this kind, "" where it can.
    """

    def __init__(
        self, kind: str, parts: Mapping[str, Part], misfit: Callable[[Any], str] = lambda part: ""
    ) -> None:
        super().__init__(parts)
        self.kind, self.misfit = kind, misfit
        self.origins: dict[str, str] = {}
        """The module that has registered a part, by the part's name."""
        _REGISTRIES.append(self)

    def register(self, name: str, part: Part) -> None:
        """Add a part. Raises ValueError for a name that another module has registered or that is no
        name, and for a part of another kind."""
        # A process of a pool runs the main module under another name.
        module = str(sys._getframe(1).f_globals["__name__"]).replace("__mp_main__", "__main__")
        if name in self and self.origins.get(name) != module:
            owner = self.origins.get(name, "hapticlink")
            raise ValueError(f"{self.kind} {name!r} is one of {owner}: take another name")
        if not isinstance(name, str) or not re.fullmatch(r"\w[\w-]*", name):
            raise ValueError(f"{self.kind} {name!r}: name it by letters, digits, _ and -")
        if why := self.misfit(part):
            raise ValueError(f"{self.kind} {name!r}: {part!r} {why}")
        self[name] = part
        self.origins[name] = module

    def base_name(self, name: str) -> str:
        """The name under which a part is listed."""
        return name

    def __missing__(self, name: str) -> Part:
        raise ValueError(self.unknown(name))

    def unknown(self, name: str, among: Iterable[str] | None = None) -> str:
        """The message that no part, or none of `among`, has this name."""
        message = unknown(self.kind, name, self if among is None else among)
        return message if "did you mean" in message else f"{message}, or those of a plugin"

    def names(self, fits: Callable[[Part], bool] = lambda part: True) -> Names[Part]:
        """The names of the parts for which `fits` holds, for `Annotated[str, ...]` of a scene's
        key."""
        return Names(self, fits)


def no_subclass(part: object, base: type) -> str:
    """Why a part is no class that is derived from `base` and complete, "" if it is."""
    if not inspect.isclass(part) or not issubclass(part, base):
        return f"is no class derived from {base.__name__}"
    missing = sorted(getattr(part, "__abstractmethods__", ()))
    return f"does not define {', '.join(missing)}" if missing else ""


def no_instance(part: object, base: type) -> str:
    """Why a part is no `base`, "" if it is."""
    return "" if isinstance(part, base) else f"is no {base.__name__}"


def no_function(part: object) -> str:
    """Why a part is no function, "" if it is."""
    return "" if callable(part) else "is no function"


@dataclass(frozen=True, eq=False)
class Names(Generic[Part]):
    """The names that are allowed for a key of a scene, evaluated when the scene is read. Iteration
    raises RuntimeError for a registry that is still empty."""

    registry: Registry[Part]
    fits: Callable[[Part], bool]

    def __iter__(self) -> Iterator[str]:
        if not self.registry:
            raise RuntimeError(f"no {self.registry.kind} is registered yet: import its room first")
        return (name for name, part in self.registry.items() if self.fits(part))

    def checked(self, name: str) -> str:
        """Returns `name`. Raises ValueError if it is none of these."""
        if self.registry.base_name(name) not in tuple(self):
            raise ValueError(self.registry.unknown(name, self))
        return name

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        """The hook by which pydantic, which reads scenes, validates the annotated key."""
        from pydantic_core import core_schema  # not needed by components themselves

        return core_schema.no_info_after_validator_function(self.checked, handler(source))


def origins(*kinds: str) -> list[str]:
    """The modules that have registered parts of these `kinds`, by default of any, sorted."""
    chosen = (r for r in _REGISTRIES if not kinds or r.kind in kinds)
    return sorted({module for registry in chosen for module in registry.origins.values()})


MAX_SHOWN = 100
"""Largest number of names that are searched and shown, and of characters of a name."""


def near(name: str, known: Iterable[str]) -> str:
    """A hint with the known name nearest to `name`, or else with the known names."""
    known = list(known)
    # No word of twice the length is a slip of the pen.
    alike = [k for k in known[:MAX_SHOWN] if abs(len(k) - len(name)) <= max(len(name) / 2, 2)]
    nearest = difflib.get_close_matches(name[:MAX_SHOWN], alike, 1)
    more = f" and {len(known) - MAX_SHOWN} more" if len(known) > MAX_SHOWN else ""
    there = ", ".join(each[:MAX_SHOWN] for each in known[:MAX_SHOWN]) or "none"
    return f"did you mean {nearest[0]!r}?" if nearest else f"there are {there}{more}"


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """The message that there is no `kind` of this name, with the hint of `near`."""
    shown = repr(name) if len(name) <= MAX_SHOWN else f"{name[:MAX_SHOWN]!r}..."
    return f"no {kind} {shown}; {near(name, known)}"
