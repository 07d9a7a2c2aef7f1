"""The result folder during a run. Results of an earlier run are kept until the first rows of this
one are on the disk."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base import interrupt, temporary_folders, text_files
from hapticlink.orchestrator.base.errors import InputFault, Interrupted
from hapticlink.orchestrator.fmi.messages import count_messages
from hapticlink.orchestrator.results import rows_file
from hapticlink.orchestrator.results.run_record import (
    End,
    RecordedFault,
    RunEnding,
    RunSetup,
    content,
)
from hapticlink.orchestrator.results.run_results import Recorder, RunResults, TableRows
from hapticlink.orchestrator.results.write_files import (
    FileRecorder,
    text,
    write_atomically,
    write_json,
    write_over,
)

ROOM = 1 << 14
"""Bytes reserved in run.json for how the run ends, in case the disk is full by then."""
RUN, LOG = "run.json", "fmus.log"


def unfinished_log(folder: Path, process: int) -> Path:
    """Where the run of a process has what its FMUs log, until it ends."""
    return folder / f".{LOG}.{process}"


class RunFolder(RunResults):
    """The folder of a run. `setup` is in run.json from the first row on.

    A context manager that records how the run ended in run.json even when an exception or a second
    signal, which ends the process at once, breaks it off. `published`: the folder has the results
    of this run. csv: whether its tables become CSVs.
    """

    def __init__(self, folder: Path, setup: RunSetup, csv: bool = True) -> None:
        super().__init__(folder)
        temporary_folders.clear_unfinished(folder)
        self._csv, self._setup = csv, content(setup)
        # What the first row needs, before the time of the loop is taken.
        self._earlier = _list_files(folder)
        self._begun = self._text(End(process=os.getpid()))
        self._log = unfinished_log(folder, os.getpid())
        self.log_path = str(self._log)

    def __enter__(self) -> RunFolder:
        interrupt.add(self._interrupted)
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        interrupt.remove(self._interrupted)
        if error is not None:
            with suppress(OSError):
                self._broken_off("fault", error)
        with suppress(OSError):
            self._keep_log()

    def _keep_log(self) -> None:
        """Where FMUs have logged something, in a run whose results are here, the log stays."""
        if self.published:
            os.replace(self._log, self.folder / LOG)
        else:
            self._log.unlink(missing_ok=True)

    def count_logged(self) -> dict[str, dict[str, int]]:
        """The number of messages in the log, by FMU and status."""
        return count_messages(self._log)

    def _new_recorder(self, clock: str, of: TableRows) -> Recorder:
        return FileRecorder(self.folder / f"{clock}.csv", of, self._publish)

    def finish(self) -> None:
        if self._csv:
            super().finish()
        else:
            for recorder in self._recorders.values():
                recorder.require_whole()

    def _publish(self) -> None:
        """Called by each recorder after its first row; once all have one, replaces the results of
        an earlier run."""
        recorders = self._recorders.values()
        if not self._may_be_published():
            return
        write_atomically(self.folder / RUN, self._begun + b" " * ROOM)
        own = {RUN, *(name for recorder in recorders for name in recorder.files)}
        for name in self._earlier - own:
            (self.folder / name).unlink(missing_ok=True)
        super()._publish()

    def leave_out(self, names: Collection[str]) -> None:
        """Have the record list no such files."""
        self._setup["files"] = [name for name in self._setup["files"] if name not in names]

    def end(self, ending: RunEnding, columns: Mapping[str, Iterable[str]]) -> None:
        """Record how the run ended in run.json. A run without rows, for which empty tables with
        these `columns` by clock are written, does so only if no earlier run has rows there. Raises
        OSError if the disk is full."""
        if not self.published and not _has_rows(self.folder):
            for clock, names in columns.items():
                suffix = ".csv" if self._csv else rows_file.SUFFIX
                with atomic_file(self.folder / f"{clock}{suffix}") as empty:
                    rows_file.write_empty(empty, ("time", *names), self._csv)
            names = self._setup["files"]
            self.leave_out([name for name in names if name.endswith(rows_file.TEXTS)])
            self.published = True
        if self.published:
            write_json(self.folder / RUN, self._setup | content(ending))

    def end_in_place(self, ending: RunEnding) -> None:
        """As `end`, on a full disk, in the bytes reserved: everything, or only how the run ended,
        or nothing if the disk cannot write in place."""
        if self.published:
            whole = content(ending)
            least = {key: whole[key] for key in ("end", "fault")}
            with suppress(OSError):
                write_over(self.folder / RUN, self._setup | whole, self._setup | least)

    def _interrupted(self) -> None:
        self._broken_off("interrupted", Interrupted(self.last))
        for recorder in self._recorders.values():
            recorder.discard()  # and closes nothing, since the loop may go on

    def _broken_off(self, reason: str, error: BaseException) -> None:
        if self.published:
            fault = RecordedFault(type(error).__name__, self.last, str(error))
            write_atomically(self.folder / RUN, self._text(End(reason, self.last), fault))

    def _text(self, end: End, fault: RecordedFault | None = None) -> bytes:
        """The run.json of a run that has not ended regularly."""
        ending = content(RunEnding(end, fault))
        known = ("end", "fault") if fault else ("end",)
        return text(self._setup | {key: ending[key] for key in known})


def _has_rows(folder: Path) -> bool:
    """Whether an earlier run in `folder` has a row behind the header of a table."""
    for name in _list_files(folder):
        if name.endswith((".csv", rows_file.SUFFIX)):
            path = folder / name
            with suppress(OSError):
                if path.is_file() and _is_longer_than_a_line(path):
                    return True
    return False


def _is_longer_than_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        return bool(file.readline(rows_file.MAX_HEADER) and file.read(1))


def _list_files(folder: Path) -> set[str]:
    """The files that the run.json of an earlier run lists, without paths outside of `folder`, and
    the rows that a run leaves that was killed."""
    try:
        names = text_files.read_json(folder / RUN).get("files", ())
        texts = (n for n in names if isinstance(n, str) and "\0" not in n)
        files = {n for n in texts if n != ".." and Path(n).name == n}
    except (InputFault, AttributeError, TypeError):
        return set()
    rows = {
        Path(name).with_suffix(suffix).name
        for name in files
        for suffix in (rows_file.SUFFIX, rows_file.TEXTS)
        if name.endswith((".csv", rows_file.SUFFIX))
    }
    files = {n for n in files if not (folder / n).is_dir() or (folder / n).is_symlink()}
    files |= {LOG} if (folder / LOG).is_file() else set()
    return files | {name for name in rows if (folder / name).exists()}
