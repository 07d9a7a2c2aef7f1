"""Results for other tools."""

from __future__ import annotations

import logging
from contextlib import nullcontext
from pathlib import Path
from typing import Literal

from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results import folders, windows
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.export import mcap, parquet


def export_results(
    run: Results | Path | str, *, to: Literal["parquet", "mcap"], out: str | Path | None = None
) -> list[Path]:
    """Write the results of a run for other tools, and return the paths: the results of `run` or
    `load`, or the folder of a run, which is read window by window, so that the memory does not grow
    with the duration.

    `to`: "parquet", a table `<rate>.parquet` for each rate with units and settings; or "mcap",
    `run.mcap` for Foxglove and Rerun: signals, energies and, where the run has its poses, the
    mechanism as a scene. Both need the extra `export`. `out` is the folder; by default the run's,
    whose run.json then lists the files.

    Raises InputFault for another format, without the extra, for results in memory without `out`,
    for a folder without a run, and if `out` cannot be written to.
    """
    if to not in ("parquet", "mcap"):
        raise InputFault(f"--to {to}: is no format; write parquet or mcap")
    own = run.folder if isinstance(run, Results) else Path(run)
    if own is None and out is None:
        raise InputFault("the results are in memory: name a folder, out=...")
    reading = nullcontext(run) if isinstance(run, Results) else windows.of_run(run)
    with reading as results:
        folder = folders.ensure(out or own or "")
        try:
            if to == "parquet":
                paths = parquet.write(results, folder)
            else:
                paths = [folder / "run.mcap"]
                if why := mcap.write(results, *paths):
                    logging.getLogger(__name__).warning("without the mechanism: %s", why)
        except ModuleNotFoundError as missing:
            remedy = install_command("export")
            raise InputFault(f"--to {to} needs {missing.name}: {remedy}") from None
    if own and folder.resolve() == own.resolve():
        folders.add(own, [path.name for path in paths])
    return paths
