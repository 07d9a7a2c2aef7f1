"""Masters that run a ring of FMUs: seconds that each takes for a number of macro steps.

A ring is a folder with the SSP of a scene, unpacked, of FMUs f0, f1, ... whose outputs y feed the
inputs u of the next. Start-up is not measured. Only this project's loop records what it computes.
"""

from __future__ import annotations

import ctypes
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from fmpy import extract, fmi2, read_model_description

from hapticlink.fmus.native import compile_library

STEP = 1 / 512
BARE = "bare_loop.c"


class Ring:
    """ssp: its file. folder: that file unpacked. n: FMUs in it."""

    def __init__(self, ssp: Path, folder: Path, n: int) -> None:
        self.ssp, self.folder, self.n = ssp, folder, n
        self.fmus = [folder / "resources" / f"f{i}.fmu" for i in range(n)]
        model = read_model_description(str(self.fmus[0]), validate=False)
        self.inputs, self.outputs = (
            [v.valueReference for v in model.modelVariables if v.causality == causality]
            for causality in ("input", "output")
        )


def ecos(ring: Ring, steps: int) -> float:
    """Its library asks for TBB's, which pip puts where no loader looks."""
    for library in sorted(Path(sys.prefix, "lib").glob("libtbb.so.12")):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    import ecospy

    with ecospy.EcosSimulation(step_size=STEP, ssp_path=str(ring.ssp)) as simulation:
        simulation.init()
        begin = perf_counter()
        simulation.step(steps)
        return perf_counter() - begin


def libcosim(ring: Ring, steps: int) -> float:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(ssp_path=str(ring.folder))
    begin = perf_counter()
    assert execution.step(steps)
    return perf_counter() - begin


@contextmanager
def _slaves(ring: Ring, folder: Path) -> Iterator[list[Any]]:
    """The FMUs of a ring, initialised, by FMPy."""
    made = []
    for i, path in enumerate(ring.fmus):
        model = read_model_description(str(path), validate=False)
        unzipped = extract(str(path), str(folder / f"fmu{i}"))
        slave = fmi2.FMU2Slave(
            guid=model.guid,
            modelIdentifier=model.coSimulation.modelIdentifier,
            unzipDirectory=unzipped,
            instanceName=f"f{i}",
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        made.append(slave)
    yield made
    for slave in made:
        slave.terminate()
        slave.freeInstance()


def fmpy(ring: Ring, steps: int, folder: Path) -> float:
    """A loop in Python over FMPy's calls."""
    with _slaves(ring, folder) as slaves:
        n = ring.n
        begin = perf_counter()
        y = [slave.getReal(ring.outputs) for slave in slaves]
        for k in range(steps):
            for i in range(n):
                slaves[(i + 1) % n].setReal(ring.inputs, y[i])
            for slave in slaves:
                slave.doStep(k * STEP, STEP)
            y = [slave.getReal(ring.outputs) for slave in slaves]
        return perf_counter() - begin


def bare(ring: Ring, steps: int, folder: Path) -> float:
    """A loop in C over the FMUs' functions alone: what they cost themselves."""
    library = folder / "bare.so"
    if not library.exists():
        compile_library(Path(__file__).parent / BARE, library)
    with _slaves(ring, folder) as slaves:
        fmus = (ctypes.c_void_p * ring.n)(*(slave.component for slave in slaves))
        names = ("fmi2SetReal", "fmi2DoStep", "fmi2GetReal")
        calls = [ctypes.cast(slaves[0].dll[name], ctypes.c_void_p) for name in names]
        signals = len(ring.inputs)
        references = ((ctypes.c_uint * signals)(*found) for found in (ring.inputs, ring.outputs))
        y = np.zeros(ring.n * signals)
        arguments = (ctypes.c_size_t(signals), ctypes.c_void_p(y.ctypes.data))
        run = ctypes.CDLL(str(library)).ring
        begin = perf_counter()
        run(
            ring.n, fmus, *calls, *references, *arguments, ctypes.c_long(steps),
            ctypes.c_double(STEP),
        )  # fmt: skip
        return perf_counter() - begin


logging.getLogger("fmpy").setLevel(logging.ERROR)
