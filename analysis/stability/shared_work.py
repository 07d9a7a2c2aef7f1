"""What the maps of one question share, such as those of a verdict: what one of them has found is
not computed again by the others; and how much was computed, which no machine changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.results.read_results import Results


@dataclass(frozen=True)
class Slopes:
    """J and E of an operation where it reads the numbers `at`."""

    at: Vector
    J: Matrix
    E: Matrix


KnownSlopes = dict[tuple[Any, ...], list[Slopes]]
"""Slopes at different numbers, the newest first, by what else they depend on."""


@dataclass(frozen=True)
class SharedWork:
    """slopes: of the blocks of the package (forward_sensitivity.py). keys: of the operations of
    each event of a period (lifted_map.py). counts: of "equilibria" that were searched, of
    operations that were "differentiated", and of "products" of the matrices of events. responses:
    of FMUs whose state cannot be read (stand_in.py). run: that of the scene in question, on whose
    inputs these are checked."""

    slopes: KnownSlopes = field(default_factory=dict)
    keys: dict[Hashable, dict[int, Any]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    responses: dict[tuple[Any, ...], Any] = field(default_factory=dict)
    run: Callable[[], Results] | None = None
