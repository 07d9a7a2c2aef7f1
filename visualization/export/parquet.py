"""Tables of a run as Apache Parquet: a file for each rate, a row group for each window."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.results.read_results import Results, recorded


def write(results: Results, folder: Path) -> list[Path]:
    """Writes `<rate>.parquet` for each recorded rate: the columns of its CSV as doubles, each with
    its `unit`; the metadata of the file has run.json as `hapticlink`."""
    import pyarrow as pa
    from pyarrow import parquet

    units = {"time": "s"} | results.record.units
    run = {"hapticlink": json.dumps(results.run)}
    names = [name for name in results.record.rates if recorded(name, results.record.files)]
    paths = {name: folder / f"{name}.parquet" for name in names}
    writers: dict[str, parquet.ParquetWriter] = {}
    with ExitStack() as files:
        for window in results.windows():
            for name, path in paths.items():
                table = window.tables[name]
                if name not in writers:
                    fields = [
                        pa.field(c, pa.float64(), False, {"unit": units[c]} if c in units else None)
                        for c in table.columns
                    ]
                    unfinished = files.enter_context(atomic_file(path))
                    writer = parquet.ParquetWriter(unfinished, pa.schema(fields, run))
                    writers[name] = files.enter_context(writer)
                rows = table.rows[window.within(table["time"])]
                columns = [pa.array(column) for column in rows.T]
                writers[name].write_table(pa.table(columns, writers[name].schema))
    return [*paths.values()]
