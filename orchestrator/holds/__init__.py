"""Holds: they give the value of an input between two samples of its source.

The hold of a plugin may have parameters, arguments of its constructor besides the context. Where
they are given, its name has them: `alpha-beta(alpha=0.5)`.
"""

from __future__ import annotations

import tomllib
from functools import cache
from typing import Any, get_args

from hapticlink.components.registry import Registry, no_subclass
from hapticlink.orchestrator.holds.hold import Hold, HoldContext, Needs
from hapticlink.orchestrator.holds.table import TABLE, HoldRow

__all__ = ["HOLDS", "Hold", "HoldContext", "HoldRow"]


def _misfit(part: Any) -> str:
    """Why a part is no hold, "" if it is one."""
    if why := no_subclass(part, Hold):
        return why
    if part.needs == "spring":
        return "needs 'spring', whose energy `pspm` alone limits: take hold = \"pspm\""
    known = (None, *get_args(Needs))
    return "" if part.needs in known else f"needs {part.needs!r}, which is none of {known}"


class Holds(Registry[HoldRow | type[Hold]]):
    """Holds by name, those of plugins also with parameters."""

    def base_name(self, name: str) -> str:
        return name.partition("(")[0]

    def __missing__(self, name: str) -> HoldRow | type[Hold]:
        base = self.base_name(name)
        kind = self[base] if base != name else super().__missing__(name)
        assert isinstance(kind, type)  # a row has no parameters, which the scene's reader says
        return _with_parameters(kind, name)


def parameters_in(name: str) -> dict[str, Any]:
    """The parameters in the name of a hold, as TOML writes them. Raises ValueError."""
    given = name.partition("(")[2]
    table: dict[str, Any] = tomllib.loads(f"given = {{{given.removesuffix(')')}}}")["given"]
    return table


@cache
def _with_parameters(kind: type[Hold], name: str) -> type[Hold]:
    """The class of a hold that is constructed with the parameters in its name."""
    given = {key: _entries(value) for key, value in parameters_in(name).items()}

    def construct(self: Hold, context: HoldContext) -> None:
        kind.__init__(self, context, **given)

    return type(kind.__name__, (kind,), {"__init__": construct, "__module__": kind.__module__})


def _entries(value: Any) -> Any:
    return tuple(map(_entries, value)) if isinstance(value, list) else value


HOLDS = Holds("hold", TABLE, _misfit)
