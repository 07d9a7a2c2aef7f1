"""Logs of a device: the pose of its handle, the wrench that its motors were given, and that of the
hand, as a run writes them to `haptics.csv`, or a lab under the same names."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hapticlink.components.port_space import PLANE
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import (
    BOARD_SENT_AT,
    HAND_WRENCH,
    MEASURED_HANDLE_POSES,
    MOTOR_WRENCH,
)
from hapticlink.orchestrator.results.read_results import Table, read_table

UNEVEN = 0.01
"""Of the sampling period, up to which samples are evenly spaced."""
LEAST = 256
"""Samples."""
SLOWEST, FASTEST = 20.0, 1e5
"""Sampling rates (Hz): below, a log says nothing of a hand, and a window of the fit has four
samples; above, a window has more than the fit has memory for, and no device is sampled so fast."""
UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units in which labs write times (s)."""


@dataclass(frozen=True)
class Log:
    """Samples that are `period` (s) apart.

    pose: of the handle, (n, 3), m, m, rad. motors: the wrench that is held from each sample on;
    hand: that of the hand, (n, 3), N, N, N.m; None where the log has none. held: the hand's wrench
    is held as well, and comes of the handle's pose at the sample alone, as in a run; else it acts
    all the time, as on a force sensor. hand_type: that of [hand] in a run, empty for other logs.
    """

    period: float
    pose: Matrix
    motors: Matrix | None
    hand: Matrix | None
    held: bool = False
    hand_type: str = ""


def read_log(path: Path | str) -> Log:
    """The log of `read_columns`. Raises InputFault for a file without the pose, or whose samples
    are not finite, not evenly spaced, or come at a rate that no device has."""
    path, table = read_columns(path)
    run = path.parent / "run.json"
    of_run = path.name == "haptics.csv" and run.is_file()
    pose = next((name for name in MEASURED_HANDLE_POSES if name in table), None)
    if not ("time" in table and pose):
        raise InputFault(
            f"{path}: a log needs the columns time (s) and {MEASURED_HANDLE_POSES[-1]}[1] to [3] "
            f"(m, m, rad), and {MOTOR_WRENCH}[1] to [3] or {HAND_WRENCH}[1] to [3] (N, N, N.m); "
            f"it has {', '.join(table.columns)}"
        )
    names = ("time", pose, MOTOR_WRENCH, HAND_WRENCH)
    signals = {name: table[name] for name in names if name in table}
    for name, values in signals.items():
        wanted = () if name == "time" else PLANE.pose.shape
        if values.shape[1:] != wanted:
            raise InputFault(
                f"{path}: {name} has a shape of {values.shape[1:]} a sample, not {wanted}"
            )
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values.reshape(len(values), -1)).all(axis=1)))
            raise InputFault(f"{path}: {name} is not finite in row {row + 1}")
    if BOARD_SENT_AT in table:
        signals = _longest_whole(signals)
    steps = np.diff(signals["time"])
    if len(steps) < LEAST:
        raise InputFault(f"{path}: {len(steps) + 1} samples; {LEAST + 1} are needed")
    period = float(np.mean(steps))
    _require_rate(path, period)
    if np.abs(steps - period).max() > UNEVEN * period:
        row = int(np.argmax(np.abs(steps - period))) + 1
        raise InputFault(
            f"{path}: row {row + 1} comes {steps[row - 1]:.4g} s after the one before, the others "
            f"{period:.4g} s on average: resample the log evenly"
        )
    return Log(
        period=period,
        pose=signals[pose],
        motors=signals.get(MOTOR_WRENCH),
        hand=signals.get(HAND_WRENCH),
        held=of_run,
        hand_type=_hand_type(run) if of_run else "",
    )


def read_columns(path: Path | str) -> tuple[Path, Table]:
    """The file of a log, and its columns: a CSV or HDF5 file (`.h5`, `.hdf5`), or that of a run in
    its folder. Raises InputFault for a file that cannot be read."""
    path = Path(path)
    if os.path.isdir(path):  # Path.is_dir raises for a name that is too long
        path = path / "haptics.csv"
    elif not text_files.exists(path):
        raise InputFault(f"{path}: cannot be read as a log: not a regular file")
    return path, _hdf5(path) if path.suffix in (".h5", ".hdf5") else read_table(path)


def _longest_whole(signals: dict[str, Matrix]) -> dict[str, Matrix]:
    """The longest stretch in which a run with a board has skipped no tick."""
    steps = np.diff(signals["time"])
    ends = np.flatnonzero(steps > 1.5 * np.median(steps)) + 1
    bounds = np.array([0, *ends, len(signals["time"])])
    k = int(np.diff(bounds).argmax())
    return {name: values[bounds[k] : bounds[k + 1]] for name, values in signals.items()}


def _require_rate(path: Path, period: float) -> None:
    """Raises InputFault for a mean time between samples (s) that no log of a device has."""
    if not period > 0.0:
        raise InputFault(f"{path}: its time does not grow from row to row: write when (s) each was")
    if SLOWEST <= 1.0 / period <= FASTEST:
        return
    rates = {u: 1.0 / period / size for u, size in UNITS.items()}
    likely = [f"{rate:g} Hz in {u}" for u, rate in rates.items() if SLOWEST <= rate <= FASTEST]
    hint = f" (it would be {' or '.join(likely)})" if likely else ""
    raise InputFault(
        f"{path}: its samples are {period:.4g} s apart, {1.0 / period:.4g} Hz, where {SLOWEST:g} "
        f"to {FASTEST:g} Hz can be fitted: write time in s{hint}, or resample the log"
    )


def _hand_type(run: Path) -> str:
    """The type of [hand] in the record of a run."""
    return str((text_files.read_json(run)["scene"].get("hand") or {}).get("type", ""))


def _hdf5(path: Path) -> Table:
    """The datasets of a file, (n,) or (n, 3), as the columns of a table."""
    try:
        import h5py
    except ImportError:
        raise InputFault(f"{path}: reading HDF5 needs h5py: {install_command('hdf5')}") from None
    try:
        with h5py.File(path) as file:
            datasets = {name: np.asarray(file[name], float) for name in file}
    except (OSError, ValueError, TypeError) as error:
        raise InputFault(
            f"{path}: cannot be read as HDF5 with datasets of numbers: {error}"
        ) from None
    columns: dict[str, np.ndarray] = {}
    for name, values in datasets.items():
        if values.ndim == 1:
            columns[name] = values
        elif values.ndim == 2:
            columns |= {f"{name}[{i + 1}]": values[:, i] for i in range(values.shape[1])}
    if len({len(values) for values in columns.values()}) != 1:
        raise InputFault(f"{path}: its datasets have no common number of samples")
    return Table(tuple(columns), np.column_stack([*columns.values()]))
