"""Completes the folder of a run whose process was killed: the CSVs of its rows, and its end in
run.json."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hapticlink.orchestrator.base import temporary_folders, text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results import folder_lock, rows_file
from hapticlink.orchestrator.results.read_results import load
from hapticlink.orchestrator.results.rows_file import RowsFile
from hapticlink.orchestrator.results.run_folder import RUN
from hapticlink.orchestrator.results.write_files import make_csv, remove_rows, write_json

KILLED = "the process of the run was killed"


class Recovered(NamedTuple):
    """Rows of a table, and the time of the last one (s); and how many behind it are damaged, which
    stay where they are."""

    rows: int
    time: float
    damaged: int = 0


def recover(
    folder: Path, kind: str = "Killed", message: str = KILLED, ended: bool = False
) -> dict[str, Recovered]:
    """What was recovered, by rate; run.json has it too, and a fault of this kind with this message
    where it did not say how the run ended. Raises InputFault where there is no run, where it still
    goes on (`ended`: it is known not to), and where another one writes to the folder."""
    process = None if ended or os.name != "posix" else load(folder).record.end.process
    if process and temporary_folders.lives(process):
        raise InputFault(f"{folder}: its run goes on, in process {process}")
    with folder_lock.lock_folder(folder):
        return _recover_tables(folder, kind, message)


def _recover_tables(folder: Path, kind: str, message: str) -> dict[str, Recovered]:
    temporary_folders.clear_unfinished(folder)
    record = load(folder).record
    recovered = {}
    for name in record.rates:
        table = folder / f"{name}.csv"
        if table.with_suffix(rows_file.SUFFIX).is_file():
            rows = RowsFile(table.with_suffix(rows_file.SUFFIX))
            damaged = rows.keep_ordered()
            make_csv(table, rows)
            newest = rows[len(rows) - 1 :] if len(rows) else np.zeros((1, 1))
            recovered[name] = Recovered(len(rows), float(newest[0, 0]), damaged)
            if not damaged:
                remove_rows(table)
    changes: dict[str, Any] = {
        "recovered": {name: {"rows": r.rows, "time": r.time} for name, r in recovered.items()}
    }
    if record.end.process is not None:
        last = load(folder).last_time  # its tables may be whole: an FMU may crash at its end
        changes["end"] = {"reason": "fault", "time": last}
        changes["fault"] = {"kind": kind, "time": last, "message": message}
    if recovered or record.end.process is not None:
        content = text_files.read_json(folder / RUN)
        write_json(folder / RUN, content | changes)
    return recovered
