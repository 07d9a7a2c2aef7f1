"""Holds: they give the value of an input between two samples of its source."""

from __future__ import annotations

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


HOLDS: Registry[HoldRow | type[Hold]] = Registry("hold", TABLE, _misfit)
