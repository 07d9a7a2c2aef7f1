"""What runs have written, and a run.json for results that no run has made."""

from dataclasses import fields
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.results.run_record import RunSetup, content


def tables_of(folder: Path) -> dict[str, bytes]:
    """The bytes of the tables in a run's folder."""
    tables = {path.name: path.read_bytes() for path in folder.glob("*.csv")}
    assert "haptics.csv" in tables
    return tables


def run_json(**changes: Any) -> dict[str, Any]:
    """The content of a run.json of which all that is not given is empty."""
    kinds = {"str": str, "list": list, "dict": dict}
    empty: dict[str, Any] = {
        f.name: kinds[str(f.type).partition("[")[0]]()
        for f in fields(RunSetup)
        if f.default is not None
    }
    record = RunSetup(**empty | {"scene": {"title": "", "linkage": None, "contacts": None}})
    return content(record) | {"end": {"reason": "running"}} | changes
