"""How often Python searches for cycles of objects, in processes of this package."""

from __future__ import annotations

import gc


def seldom() -> None:
    """Modules and figures are many objects that stay: searching them for cycles takes 5 % of a run,
    and as much again three times as the process ends, without `none_of_these`."""
    gc.set_threshold(200_000)


def none_of_these() -> None:
    """The objects that there are now are left out of every search."""
    gc.freeze()
