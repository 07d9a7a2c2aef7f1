"""A run.json for results that no run has made."""

from dataclasses import fields
from typing import Any

from hapticlink.orchestrator.results.run_record import RunSetup, content


def run_json(**changes: Any) -> dict[str, Any]:
    """The content of a run.json of which all that is not given is empty."""
    kinds = {"str": str, "list": list, "dict": dict}
    empty: dict[str, Any] = {
        f.name: kinds[str(f.type).partition("[")[0]]() for f in fields(RunSetup)
    }
    record = RunSetup(**empty | {"scene": {"title": "", "linkage": None, "contacts": None}})
    return content(record) | {"end": {"reason": "running"}} | changes
