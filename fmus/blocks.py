"""The FMU of a block by its name in `components.blocks.BLOCKS`, from the cache or built."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from pydantic_core import to_jsonable_python

from hapticlink.components.blocks import BLOCKS
from hapticlink.fmus import cache
from hapticlink.fmus.errors import FmuError

if TYPE_CHECKING:
    from hapticlink.components.component import Component

Settings = Mapping[str, Any]
Starts = Mapping[str, tuple[float, ...]]
"""By parameter, one value an entry."""
Packaging = Literal["python", "native"]


def component(name: str, settings: Settings, starts: Starts = MappingProxyType({})) -> Component:
    """The component of the block `name` with `settings`; `starts` replace start values of its
    parameters. Raises FmuError if the settings give no component."""
    try:
        result = BLOCKS[name](**settings)
    except (ValueError, ArithmeticError) as error:
        raise FmuError(f"{name}: {error}") from error
    from hapticlink.components.component import Component  # loads casadi, as the block has done

    if not isinstance(result, Component):
        raise FmuError(f"{name}: the block gives {result!r}, no Component")
    parameters = tuple(replace(p, start=starts.get(p.name, p.start)) for p in result.parameters)
    return replace(result, parameters=parameters)


def build_block(name: str, settings: Settings, build_folder: Path, **how: Any) -> Path:
    """The path of the block's FMU: in the cache, or built. As `find_block`."""
    found = find_block(name, settings, build_folder, **how)
    return found if isinstance(found, Path) else found()


def find_block(
    name: str,
    settings: Settings,
    build_folder: Path,
    *,
    experiment: Mapping[str, float] = MappingProxyType({}),
    packaging: Packaging = "python",
    platforms: Sequence[str] = (),
    fmi: int = 2,
    starts: Starts = MappingProxyType({}),
    engine: str | None = None,
    poll: Callable[[], object] = lambda: None,
) -> Path | Callable[[], Path]:
    """The path of the block's FMU in the cache, or what builds it and gives its path: in
    `build_folder` where the cache is off.

    settings: the block's own, by name; starts: start values that replace those of its parameters.
    experiment: stop_time and step_size (s) of the default experiment. platforms: those of a native
    FMU, by default this machine's; fmi: its version of the standard. engine: the physics engine by
    which it is made. poll: called while another process builds it. Raises FmuError if the settings
    give no FMU, CompilerError if it cannot be compiled.
    """

    def make(folder: Path) -> Path:
        from hapticlink.fmus.build_fmu import build, build_engine, build_native
        from hapticlink.fmus.fmu_functions import GRAPHS

        with GRAPHS:
            block = component(name, settings, starts)
            if engine:
                return build_engine(block, settings, folder, **experiment)
            if packaging == "python":
                return build(block, folder, **experiment)
        return build_native(block, folder, platforms=platforms, fmi=fmi, **experiment)

    material = _block_material(name, settings) | dict(experiment)
    if engine:
        material["engine"] = engine
    if starts:
        material["starts"] = dict(starts)
    if packaging == "native" and not engine:
        material |= _native_material(platforms, fmi)
    return cache.find(material) or partial(cache.get_or_build, material, make, build_folder, poll)


def has_compiled(name: str, settings: Settings) -> bool:
    """Whether the cache has the native FMU of a block for this machine."""
    try:
        return bool(cache.find(_block_material(name, settings) | _native_material((), fmi=2)))
    except FmuError:  # none can be made here
        return False


def _block_material(name: str, settings: Settings) -> dict[str, Any]:
    return {"block": name, "settings": to_jsonable_python(dict(settings))}


def _native_material(platforms: Sequence[str], fmi: int) -> dict[str, Any]:
    from hapticlink.fmus.native.compiler import compiler_version, host_platform

    chosen = list(platforms) or [host_platform(fmi)]
    return {"compiler": compiler_version(), "platforms": chosen, "fmi": fmi}
