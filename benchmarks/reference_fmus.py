"""The Reference-FMUs of the Modelica Association, run by hapticlink and by FMPy over one grid:

    python -m benchmarks.reference_fmus build2/fmus build3/fmus

of the folders into which CMake has built github.com/modelica/Reference-FMUs, with -DFMI_VERSION=2
and 3. It prints a row for each FMU and rate: the largest difference of an output that is a number.
FMPy uses event mode and early return as hapticlink does: where the FMU has them. Roberts declares
event mode, and its library refuses it.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description, simulate_fmu

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate

EXPERIMENTS = {
    "BouncingBall": ((100,), 3.0), "Clocks": ((1,), 10.0), "Dahlquist": ((10,), 10.0),
    "Feedthrough": ((10,), 2.0), "Resource": ((10,), 1.0), "Roberts": ((1000, 1024), 1.0),
    "Stair": ((5,), 10.0), "StateSpace": ((1,), 10.0), "VanDerPol": ((100,), 20.0),
}  # fmt: skip
"""Rates (Hz) and duration (s), those of the default experiment where it gives a step."""
SCENE = """title = "{name}"
duration = {duration}
haptics.rate = {rate}
[[fmu]]
name = "fmu"
path = "{path}"
"""


def found(path: Path, rate: int, duration: float, folder: Path) -> str:
    """Rows, outputs and largest difference, or why the FMU is not run."""
    scene = folder / f"{path.stem}.toml"
    scene.write_text(SCENE.format(name=path.stem, duration=duration, rate=rate, path=path))
    try:
        ended = simulate(scene, folder / f"{path.stem}_{rate}")
    except InputFault as refused:
        return f"refused: {refused}".replace(str(path), path.name).splitlines()[-1].strip()
    if fault := ended.outcome.fault:
        return f"fault: {fault}"
    ours = ended.results.haptics
    model = read_model_description(str(path))
    events = bool(getattr(model.coSimulation, "hasEventMode", False)) and path.stem != "Roberts"
    written = ("String", "Binary", "Clock")
    outputs = (v for v in model.modelVariables if v.causality == "output")
    names = [v.name for v in outputs if v.type not in written]
    theirs = simulate_fmu(
        str(path), start_time=0.0, stop_time=duration, output_interval=1 / rate, output=names,
        use_event_mode=events, early_return_allowed=events,
    )  # fmt: skip
    # FMPy has a row before and after each event: the last of an instant is what holds from there.
    rows = np.searchsorted(theirs["time"], ours["time"] + 1e-9, side="right") - 1
    differences = [
        np.abs(ours[f"fmu.{name}"] - column[rows].astype(float)).max()
        for name, column in _columns(theirs, names)
    ]
    return f"{len(rows)} rows, {len(differences)} outputs, {max(differences):.2g}"


def _columns(result: Any, names: list[str]) -> Iterator[tuple[str, Any]]:
    """The entries of each output, as hapticlink calls them."""
    for name in names:
        if result[name].ndim == 1:
            yield name, result[name]
        else:
            yield from ((f"{name}[{i + 1}]", c) for i, c in enumerate(result[name].T))


def main(folders: list[str]) -> None:
    with tempfile.TemporaryDirectory() as room:
        for folder in folders:
            for path in sorted(Path(folder).absolute().glob("*.fmu")):
                version = read_model_description(str(path)).fmiVersion
                rates, duration = EXPERIMENTS[path.stem]
                for rate in rates:
                    row = found(path, rate, duration, Path(room))
                    print(f"| {path.stem} | {version} | {rate} Hz | {row} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
