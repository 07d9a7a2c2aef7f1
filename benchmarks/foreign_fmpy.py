"""One FMU run by FMPy, for `foreign_runs`: `python -m benchmarks.foreign_fmpy ASKED.json`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description, simulate_fmu

NOT_NUMBERS = ("String", "Binary", "Clock")


def run(asked: dict[str, Any]) -> dict[str, np.ndarray]:
    """By output, entry by entry as hapticlink calls them, and `time`."""
    path, rate, duration = asked["path"], asked["rate"], asked["duration"]
    model = read_model_description(path, validate=False)
    exchange = asked["interface"] == "model-exchange"
    events = not exchange and bool(getattr(model.coSimulation, "hasEventMode", False))
    outputs = [v for v in model.modelVariables if v.causality == "output"]
    names = [v.name for v in outputs if v.type not in NOT_NUMBERS]
    given: dict[str, Any] = {
        "validate": False, "fmi_type": "ModelExchange" if exchange else "CoSimulation",
        "start_time": 0.0, "stop_time": duration, "start_values": asked["start"],
        "output_interval": 1 / rate, "output": names, "input": _inputs(asked),
    }  # fmt: skip
    try:
        found = simulate_fmu(path, use_event_mode=events, early_return_allowed=events, **given)
    except Exception as error:  # FMPy raises Exception itself
        if not events or "instantiate" not in str(error):
            raise
        found = simulate_fmu(path, **given)  # it declares event mode, and its library refuses it
    return dict(_columns(found, names))


def _inputs(asked: dict[str, Any]) -> np.ndarray | None:
    """A row at each communication point, where FMPy interpolates without rounding, and two where
    the inputs change."""
    if not asked["inputs"]:
        return None
    before, after = zip(*asked["inputs"].values(), strict=True)
    kinds = [np.bool_ if isinstance(v, bool) else type(v) for v in before]
    times = [k / asked["rate"] for k in range(round(asked["rate"] * asked["duration"]) + 1)]
    rows = [(t, *before) for t in times if t <= asked["at"]]
    rows += [(t, *after) for t in times if t >= asked["at"]]
    return np.array(rows, [("time", float), *zip(asked["inputs"], kinds, strict=True)])


def _columns(found: np.ndarray, names: list[str]) -> Iterator[tuple[str, np.ndarray]]:
    for name in ["time", *names]:
        column = found[name].astype(float)
        if column.ndim == 1:
            yield name, column
        else:
            entries = column.reshape(len(column), -1).T
            yield from ((f"{name}[{i + 1}]", entry.copy()) for i, entry in enumerate(entries))


def main() -> None:
    asked = json.loads(Path(sys.argv[1]).read_text())
    try:
        found = run(asked)
    except Exception as error:  # FMPy raises Exception itself
        sys.exit(" ".join(str(error).split()))
    np.savez(asked["out"], allow_pickle=False, **found)


if __name__ == "__main__":
    main()
