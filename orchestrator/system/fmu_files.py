"""The FMU files of a scene's blocks, from the cache or built."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from hapticlink.components.ports import STEP_SIZE
from hapticlink.fmus.blocks import Starts, find_block, has_compiled
from hapticlink.fmus.cache import folder, remove_locks
from hapticlink.fmus.errors import CompilerError, FmuError
from hapticlink.fmus.native.compiler import compiler_version
from hapticlink.orchestrator.base import interrupt, plugins, shelf
from hapticlink.orchestrator.base.errors import Fault, InputFault, SceneFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi.process_cache import MAX_UNPACKED, File, file_at
from hapticlink.orchestrator.scene.blocks import BlockPlan, Blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.step_sizes import sizes

LOG = logging.getLogger(__name__)
"""Says, at level INFO, which block is begun to be built, or taken from the cache."""

_prefers_compiled = ContextVar("_prefers_compiled", default=False)


@contextmanager
def prefer_compiled() -> Iterator[None]:
    """Within the context blocks are native FMUs, which give the same bits as Python ones and take a
    third of the time, where the cache has them; in this thread, not in others."""
    before = _prefers_compiled.set(True)
    try:
        yield
    finally:
        _prefers_compiled.reset(before)


def fmu_files(
    scene: Scene,
    blocks: Blocks,
    timeline: Timeline,
    room: Path,
    platforms: Sequence[str] = (),
    starts: Mapping[str, Starts] | None = None,
    fmi: int = 2,
) -> dict[str, Path]:
    """The FMU file of each block by its name, from the cache, or built in `room` where the cache is
    off.

    platforms: those of native FMUs, by default this machine's; fmi: their version of the standard.
    starts: for FMUs that other tools run, by block, values that replace the start values of its
    parameters; these also have the scene's step sizes, gains and default experiment, which a run
    sets itself: it needs one FMU for all of them. Raises InputFault where no FMU can be built from
    the settings (a loop that does not close), with the line of those of an [[fmu]], and Fault where
    the compiler fails.
    """
    every = (*blocks.built, *blocks.engines)
    begun, cached_in = count(1), folder()

    def find(block: BlockPlan) -> Path | Callable[[], Path]:
        interrupt.raise_if_interrupted()
        LOG.info("building block %d of %d: %s", next(begun), len(every), block.name)
        given: Starts = {}
        experiment: dict[str, float] = {}
        settings, packaging = block.settings, scene.packaging
        # A state fits the FMU that saved it.
        prefers = _prefers_compiled.get() and not (scene.resume or block.engine)
        if starts is not None:
            steps = sizes(timeline.of[block.name], timeline)
            given = {
                **{name: (step,) for name, step in steps.items()},
                **starts.get(block.name, {}),
            }
            experiment = {"stop_time": scene.stop_time, "step_size": steps[STEP_SIZE]}
        how: dict[str, Any] = {
            "packaging": packaging,
            "experiment": experiment,
            "platforms": platforms,
            "fmi": fmi,
            "starts": given,
            "engine": block.engine,
        }
        compiled = packaging == "native" and not block.engine
        compiler = compiler_version() if compiled else ""
        made_of = repr((block.block, settings, how, prefers, cached_in, compiler))
        if path := _find_again(made_of):
            return path
        if prefers and has_compiled(block.block, settings):
            how["packaging"] = "native"
        own = room / block.name  # two hands are two files of one name
        found = find_block(block.block, settings, own, **how, poll=interrupt.raise_if_interrupted)
        if isinstance(found, Path) and not plugins.list_plugins():
            _FOUND.put((made_of, file_at(found)))
        return found

    try:
        found = {b.name: find(b) for b in every}
        missing = {name: f for name, f in found.items() if not isinstance(f, Path)}
        built = _build({n: partial(_build_placed, scene, n, f) for n, f in missing.items()})
        return {name: f if isinstance(f, Path) else built[name] for name, f in found.items()}
    except CompilerError as error:
        interrupt.raise_if_interrupted()  # Ctrl-C in a terminal ends the compiler too
        raise Fault(str(error)) from error
    except FmuError as error:
        raise InputFault(str(error)) from error


def _build_placed(scene: Scene, name: str, build: Callable[[], Path]) -> Path:
    """The file of a block. Raises SceneFault with the line of the settings of an [[fmu]] that give
    none, or of the one that the message names."""
    try:
        return build()
    except CompilerError:
        raise
    except FmuError as error:
        for i, fmu in enumerate(scene.fmu):
            if fmu.name == name and fmu.block:
                named = [key for key in fmu.settings if f"`{key}`" in str(error)]
                place = scene.place(("fmu", i, "settings", *named[:1]), str(error))
                raise SceneFault(scene.title, [place]) from error
        raise


_FOUND: shelf.Shelf[tuple[str, File]] = shelf.Shelf(MAX_UNPACKED)
"""What files in the cache are made of, as text, in which 0.0 is not -0.0, nor 1 True: finding one
takes a hash of that, and of more."""


def _find_again(made_of: str) -> Path | None:
    """The file that was found before for the same, if it has not changed since."""
    known = _FOUND.take(lambda item: item[0] == made_of)
    with suppress(OSError):
        if known and file_at(known[1][0]) == known[1]:
            _FOUND.put(known)
            return known[1][0]
    return None


def _build(missing: Mapping[str, Callable[[], Path]]) -> dict[str, Path]:
    """The files of blocks that are not in the cache. While one is compiled, the equations of the
    next are derived."""
    if not missing:
        return {}
    interrupt.add(remove_locks)
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        files = pool.map(lambda build: build(), missing.values())
        return dict(zip(missing, files, strict=True))
    finally:
        pool.shutdown(cancel_futures=True)
        interrupt.remove(remove_locks)
