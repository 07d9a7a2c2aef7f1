"""The loops in C that call FMUs and do nothing else: what they cost themselves, without holds,
checks, energies and tables."""

from __future__ import annotations

import ctypes
from contextlib import ExitStack
from pathlib import Path
from time import thread_time

import numpy as np

from hapticlink.fmus.native import compile_library

SOURCE = Path(__file__).with_name("bare_loop.c")


def bare_loop(folder: Path) -> ctypes.CDLL:
    """The library of bare_loop.c, compiled in `folder`."""
    library = folder / "bare.so"
    if not library.exists():
        compile_library(SOURCE, library)
    return ctypes.CDLL(str(library))


class Bare(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("fmu", "set", "step", "get", "inputs", "outputs")),
        *((name, ctypes.c_size_t) for name in ("n_inputs", "n_outputs")),
        *((name, ctypes.c_void_p) for name in ("sources", "u", "y")),
        ("rate", ctypes.c_double),
    )


def seconds(scene: str, options: list[str], steps: int, folder: Path) -> float:
    """Processor time of `steps` steps of the fastest FMUs of a scene, initialised as in a run, in a
    loop that hands their outputs on as they are. All variables have to be reals of FMI 2.0 at fixed
    rates."""
    # A ring alone, whose start-up is measured, needs none of these.
    from hapticlink.orchestrator import open_scene
    from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
    from hapticlink.orchestrator.results.run_results import RunResults
    from hapticlink.orchestrator.run.simulation import Simulation
    from hapticlink.orchestrator.system.build_system import build_system

    run = bare_loop(folder).loop
    with build_system(open_scene.load(scene, options)) as system, ExitStack() as stack:
        simulation = Simulation(system, RunResults(), stack)
        simulation.start()
        kept: list[object] = []
        rates = {c.name: 1 / system.timeline.seconds(c.longest) for c in system.timeline.clocks}
        made = (Bare * len(system.fmus))()
        for c, fmu in zip(made, system.fmus, strict=True):
            instance = simulation.instances[fmu.name]
            assert isinstance(instance, InProcess)
            (get,), dll = instance.gets, instance.slave.dll
            scalars = [s for wire in system.into(fmu.name) for s in wire.inputs]
            places = [p for w in system.into(fmu.name) for p in simulation.signals.sources(w)]
            inputs = np.array([s.reference for s in scalars], np.uint32)
            sources, u = np.array(places, np.int64), np.zeros(len(places))
            kept += [inputs, sources, u]
            c.fmu, c.rate = instance.slave.component, rates[fmu.clock]
            c.set, c.step, c.get = (
                ctypes.cast(dll[f"fmi2{name}"], ctypes.c_void_p).value
                for name in ("SetReal", "DoStep", "GetReal")
            )
            c.inputs, c.n_inputs = inputs.ctypes.data, len(inputs)
            c.outputs, c.n_outputs = ctypes.addressof(get.references), len(get.references)
            c.sources, c.u, c.y = sources.ctypes.data, u.ctypes.data, get.values.ctypes.data
        values = ctypes.c_void_p(simulation.signals.values.ctypes.data)
        fastest = ctypes.c_double(max(rates.values()))
        begin = thread_time()
        status = run(len(made), made, values, fastest, ctypes.c_long(steps))
        taken = thread_time() - begin
        assert status == 0, f"{scene}: a step has returned {status}"
        return taken
