"""What a run tells in the terminal beside how it ended: where it is not what was asked for."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from hapticlink.orchestrator import assembled
from hapticlink.orchestrator.assembled import MECHANISM
from hapticlink.orchestrator.results import Results
from hapticlink.orchestrator.tracking import table_of


def lines(results: Results) -> Iterator[str]:
    """A line for each kind of thing in run.json, and for each joint whose start was moved far."""
    run = results.run
    yield from _start(results)
    for fmu, count in run["held_outputs"].items():
        yield f'{fmu}: {count} outputs were not finite and held (faults.nan = "hold")'
    for fmu, count in run["smaller_steps"].items():
        yield f"{fmu}: {count} steps were discarded and taken again in smaller ones"
    if (found := run["iterations"]) and found["unconverged"]:
        yield f"{found['unconverged']} of {found['steps']} iterated steps did not converge"
    for clock, steps in run["controlled_steps"].items():
        if steps["forced"]:
            few = f"{steps['forced']} of {steps['taken']} steps were taken at the least size"
            yield f"{clock}: {few} though their error was too large"
    for name, link in run["links"].items():
        if link["lost"] or link["overtaken"]:
            lost = f"{link['lost']} of {link['sent']} samples were lost"
            yield f"{name}: {lost}, {link['overtaken']} overtaken"
    refused = sorted(run["holds_that_did_not_fit"].items(), key=lambda item: item[1]["hold"])
    for hold, group in groupby(refused, key=lambda item: item[1]["hold"]):
        gave_way = [f"{name} ({why['reason']})" for name, why in group]
        more = f" and {len(gave_way) - 1} more" if len(gave_way) > 1 else ""
        yield f"hold {hold} does not fit {gave_way[0]}{more}: zoh there"


def _start(results: Results) -> Iterator[str]:
    linkage = results.run["scene"]["linkage"]
    table = table_of(results, f"{MECHANISM}.q")
    if linkage and table and len(table["time"]):
        yield from assembled.moved(linkage, table[f"{MECHANISM}.q"][0])
