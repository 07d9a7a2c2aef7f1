"""Masters that run a ring of FMUs. Each is started with a ring and returns a function: the
processor time (s), which other processes hardly change, that a number of macro steps takes. Only
this project's loop records what it computes."""

from __future__ import annotations

import ctypes
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

STEP = 1 / 512
SCENE, SSP = "ring.toml", "ring.ssp"
Steps = Callable[[int], float]


class Ring:
    """folder: with the SSP of a ring: f0, f1, ..., each of which takes the outputs y of the one
    before as its inputs u."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.ssp, self.unpacked = folder, folder / SSP, folder / "ssp"
        self.n = len(list((self.unpacked / "resources").glob("f*.fmu")))
        self.fmus = [self.unpacked / "resources" / f"f{i}.fmu" for i in range(self.n)]


def timed(run: Callable[[int], object]) -> Steps:
    """The processor time that `run` takes."""

    def seconds(steps: int) -> float:
        begin = process_time()
        run(steps)
        return process_time() - begin

    return seconds


def went_on(run: Callable[[int, int], object]) -> Steps:
    """The processor time that `run` takes, which is given the number of steps before it, too: an
    FMU refuses a step that begins elsewhere than where it stands. `run` returns what is not 0 where
    a step was refused."""
    first = 0

    def further(steps: int) -> None:
        nonlocal first
        if run(first, steps):
            raise RuntimeError(f"a step of {first} to {first + steps} was refused")
        first += steps

    return timed(further)


def ours(ring: Ring) -> Steps:
    """Our loop, which records: each call is a run of its own."""
    from benchmarks import rings  # only what a master needs is loaded
    from benchmarks.timing import simulated

    rings.register()

    def seconds(steps: int) -> float:
        duration = f"duration={steps / 512!r}"
        made = simulated(str(ring.folder / SCENE), ring.folder / "out", [duration])
        return made.outcome.wall_time

    seconds(1)
    return seconds


def ecos(ring: Ring) -> Steps:
    """Its library asks for TBB's, which pip puts where no loader looks."""
    for library in sorted(Path(sys.prefix, "lib").glob("libtbb.so.12")):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    import ecospy

    simulation = ecospy.EcosSimulation(step_size=STEP, ssp_path=str(ring.ssp))
    simulation.init()
    return timed(simulation.step)


def libcosim(ring: Ring) -> Steps:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(ssp_path=str(ring.unpacked))

    def run(steps: int) -> None:
        assert execution.step(steps)

    return timed(run)


def _slaves(ring: Ring, one_library: bool = False) -> tuple[list[Any], list[int], list[int]]:
    """The FMUs of a ring, initialised, by FMPy; the references of an FMU's inputs and outputs.
    one_library: all are instances of the first, whose file each of them is."""
    from fmpy import extract, fmi2, read_model_description

    logging.getLogger("fmpy").setLevel(logging.ERROR)
    model = read_model_description(str(ring.fmus[0]), validate=False)
    inputs, outputs = (
        [v.valueReference for v in model.modelVariables if v.causality == causality]
        for causality in ("input", "output")
    )
    made = []
    unpacked = ring.fmus[:1] if one_library else ring.fmus
    folders = [extract(str(path), str(ring.folder / f"fmu{i}")) for i, path in enumerate(unpacked)]
    for i, path in enumerate(ring.fmus):
        model = read_model_description(str(path), validate=False)
        slave = fmi2.FMU2Slave(
            guid=model.guid,
            modelIdentifier=model.coSimulation.modelIdentifier,
            unzipDirectory=folders[0 if one_library else i],
            instanceName=f"f{i}",
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        made.append(slave)
    return made, inputs, outputs


def fmpy(ring: Ring) -> Steps:
    """A loop in Python over FMPy's calls."""
    slaves, inputs, outputs = _slaves(ring)

    def run(first: int, steps: int) -> None:
        y = [slave.getReal(outputs) for slave in slaves]
        for k in range(first, first + steps):
            for i, values in enumerate(y):
                slaves[(i + 1) % ring.n].setReal(inputs, values)
            for slave in slaves:
                slave.doStep(k * STEP, STEP)
            y = [slave.getReal(outputs) for slave in slaves]

    return went_on(run)


def _functions(slaves: list[Any]) -> list[tuple[Any, ...]]:
    """fmi2SetReal, fmi2DoStep and fmi2GetReal of each FMU, and its component."""
    names = ("fmi2SetReal", "fmi2DoStep", "fmi2GetReal")
    return [(*(slave.dll[name] for name in names), slave.component) for slave in slaves]


def calls_by_ctypes(ring: Ring) -> Steps:
    """A loop in Python over the FMUs' functions, without FMPy's lists and checks: all arguments
    that do not change are made before, and only the last status is looked at."""
    slaves, inputs, outputs = _slaves(ring)
    n = ctypes.c_size_t(len(inputs))
    u, y = ((ctypes.c_uint * len(found))(*found) for found in (inputs, outputs))
    values = [(ctypes.c_double * len(outputs))() for _ in slaves]
    calls = [
        (set_real, do_step, get_real, ctypes.c_void_p(fmu), values[i - 1], values[i])
        for i, (set_real, do_step, get_real, fmu) in enumerate(_functions(slaves))
    ]
    size = ctypes.c_double(STEP)

    def run(first: int, steps: int) -> int:
        for k in range(first, first + steps):
            time = ctypes.c_double(k * STEP)
            for set_real, _, _, fmu, before, _ in calls:
                set_real(fmu, u, n, before)
            for _, do_step, _, fmu, _, _ in calls:
                status = do_step(fmu, time, size, 1)
            for _, _, get_real, fmu, _, own in calls:
                get_real(fmu, y, n, own)
        return int(status)

    return went_on(run)


def bare(ring: Ring) -> Steps:
    """A loop in C over the FMUs' functions alone: what they cost themselves."""
    from benchmarks.peers.bare_loop import bare_loop

    slaves, inputs, outputs = _slaves(ring, one_library=True)
    calls = [
        [ctypes.cast(function, ctypes.c_void_p).value for function in found]
        for found in _functions(slaves)
    ]
    of = (ctypes.c_void_p * (4 * ring.n))(*(address for found in calls for address in found))
    references = [(ctypes.c_uint * len(found))(*found) for found in (inputs, outputs)]
    signals = len(inputs)
    y = np.zeros(ring.n * signals)
    run, size = bare_loop(ring.folder.parent).ring, ctypes.c_double(STEP)
    arguments = (*references, ctypes.c_size_t(signals), np.ctypeslib.as_ctypes(y))
    return went_on(lambda *k: run(ring.n, of, *arguments, *map(ctypes.c_long, k), size))


MASTERS: dict[str, Callable[[Ring], Steps]] = {
    "C loop": bare,
    "hapticlink": ours,
    "Ecos": ecos,
    "libcosim": libcosim,
    "ctypes": calls_by_ctypes,
    "FMPy": fmpy,
}
