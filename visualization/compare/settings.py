"""What was set differently in the scenes of runs, by dotted keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hapticlink.orchestrator.results.read_results import Results

UNSET = "-"
ABOUT = ("title", "description", "format", "experiment")
"""Keys that change nothing in a run."""
RENAMED = "`closed-loop` of a scene without a format is `closed-loop-ideal` of format 2"
"""What the names of shipped scenes were when scenes had no format."""


def differing(runs: Sequence[Results]) -> dict[str, tuple[str, ...]]:
    """The keys of which the scenes have different values, with the value of each; entries of lists
    of tables are named by their `name` or counted from 1. Without the tables of blocks in whose
    place a run had an FMU, which say nothing of it."""
    unused = {block for run in runs for block in run.record.replaced}
    every = [dict(_leaves(run.record.scene)) for run in runs]
    keys = dict.fromkeys(key for leaves in every for key in leaves)
    values = {key: tuple(leaves.get(key, UNSET) for leaves in every) for key in keys}
    return {
        k: v
        for k, v in values.items()
        if len(set(v)) > 1 and k not in ABOUT and k.partition(".")[0] not in unused
    }


def other_scenes(runs: Sequence[Results]) -> str:
    """A sentence where the runs are of scenes with other titles, mechanisms or formats; ""
    where not."""
    titles = dict.fromkeys(run.record.scene["title"] for run in runs)
    told = []
    if not one_mechanism(runs):
        told.append(f"different mechanisms: {'; '.join(titles)}")
    elif len(titles) > 1:
        told.append(f"different scenes: {'; '.join(titles)}")
    if len({run.record.scene.get("format") for run in runs}) > 1:
        told.append(f"different formats of scenes: {RENAMED}")
    return "; ".join(told)


def one_mechanism(runs: Sequence[Results]) -> bool:
    """Whether all runs are of the same linkage, so that their poses can be compared."""
    return all(run.record.scene["linkage"] == runs[0].record.scene["linkage"] for run in runs)


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value:
        for name, entry in value.items():
            yield from _leaves(entry, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
        for i, each in enumerate(value, 1):
            yield from _leaves(each, f"{key}[{each.get('name') or i}]")
    elif value not in (None, {}, []):
        yield key, str(value).lower() if isinstance(value, bool) else str(value)
