"""One FMU run by FMPy, for `foreign_runs`: `python -m benchmarks.foreign_fmpy ASKED.json`."""

from __future__ import annotations

import ctypes
import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description, simulate_fmu


def run(asked: dict[str, Any]) -> dict[str, np.ndarray]:
    """By signal, entry by entry as hapticlink calls them, `time`, and `fastest` as in
    `foreign_runs.Comparison`."""
    path, rate, duration = asked["path"], asked["rate"], asked["duration"]
    model = read_model_description(path, validate=False)
    exchange = asked["interface"] == "model-exchange"
    events = not exchange and bool(getattr(model.coSimulation, "hasEventMode", False))
    names, kind = asked["signals"], "ModelExchange" if exchange else "CoSimulation"
    given: dict[str, Any] = {
        "validate": False, "fmi_type": kind, "start_time": 0.0, "stop_time": duration,
        "start_values": asked["start"], "relative_tolerance": asked["tolerance"],
        "output_interval": 1 / rate, "output": names, "input": _inputs(asked),
    }  # fmt: skip
    if exchange:
        with tempfile.TemporaryDirectory() as folder:
            extract(path, folder)
            fmu, decays = instantiate_fmu(folder, model, kind), [0.0]

            def look(time: float, _: Any) -> bool:
                if time >= duration * (1 - 1e-9):
                    decays.append(find_fastest_decay(fmu, model.numberOfContinuousStates))
                return True

            found = simulate_fmu(folder, fmu_instance=fmu, step_finished=look, **given)
            fmu.freeInstance()
        return {"fastest": np.array(decays[-1]), **dict(_columns(found, names))}
    try:
        found = simulate_fmu(path, use_event_mode=events, early_return_allowed=events, **given)
    except Exception as error:  # FMPy raises Exception itself
        if not events or "instantiate" not in str(error):
            raise
        found = simulate_fmu(path, **given)  # it declares event mode, and its library refuses it
    return {"fastest": np.zeros(()), **dict(_columns(found, names))}


def find_fastest_decay(fmu: Any, n: int) -> float:
    """The largest -Re (1/s) of an eigenvalue of the Jacobian of the derivatives of the `n` states
    where the FMU is, by forward differences; 0 without states and where all grow or keep
    turning."""
    if not n:
        return 0.0
    x, dx, moved = np.empty(n), np.empty(n), np.empty(n)
    here, there = (_pointer(values) for values in (dx, moved))
    derive = getattr(fmu, "getContinuousStateDerivatives", None) or fmu.getDerivatives
    fmu.getContinuousStates(_pointer(x), n)
    derive(here, n)
    jacobian = np.empty((n, n))
    for k in range(n):
        other = x.copy()
        other[k] += 1e-7 * max(1.0, abs(x[k]))
        fmu.setContinuousStates(_pointer(other), n)
        derive(there, n)
        jacobian[:, k] = (moved - dx) / (other[k] - x[k])
    fmu.setContinuousStates(_pointer(x), n)
    return float(max(0.0, -np.linalg.eigvals(jacobian).real.min()))


def _pointer(values: np.ndarray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


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
