"""The blocks by name: which settings each is made of, and its FMU, from the cache if it can.

The factories are imported when a block is built, so a cached FMU needs no casadi.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from hapticlink.fmus import cache
from hapticlink.fmus.errors import FmuError

if TYPE_CHECKING:
    from hapticlink.components.component import Component

Settings = Mapping[str, Any]
Packaging = Literal["python", "native"]


def _virtual_mechanism(s: Settings, step_s: float) -> Component:
    from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism

    parts = {k: s[k] for k in ("directions", "contacts", "length_scale", "frame_s") if k in s}
    return virtual_mechanism(s["linkage"], s["mechanism"], **parts, step_s=step_s)


def _virtual_environment(s: Settings, step_s: float) -> Component:
    from hapticlink.components.blocks.virtual_environment import virtual_environment

    parts = {k: s[k] for k in ("contacts", "mobility", "local_model") if k in s}
    return virtual_environment(s["linkage"], s["graphics"], s["directions"], **parts)


def _haptic_device(s: Settings, step_s: float) -> Component:
    from hapticlink.components.blocks.haptic_device import haptic_device

    return haptic_device(s["device"])


def _controller(s: Settings, step_s: float) -> Component:
    from hapticlink.components.blocks.controller import controller
    from hapticlink.components.linkage.parameters import mean_link_length

    length_scale = s["directions"].length_scale
    if length_scale is None:
        length_scale = mean_link_length(s["linkage"])
    return controller(s["controller"], length_scale)


def _hand(s: Settings, step_s: float) -> Component:
    from hapticlink.components.blocks.hand import hand

    return hand(s["hand"])


def _discrete_equivalent(s: Settings, step_s: float) -> Component:
    from hapticlink.components.blocks.discrete_equivalent import discrete_equivalent

    return discrete_equivalent(s["rule"])


BLOCKS: dict[str, Callable[[Settings, float], Component]] = {
    "virtual_mechanism": _virtual_mechanism,
    "virtual_environment": _virtual_environment,
    "haptic_device": _haptic_device,
    "controller": _controller,
    "hand": _hand,
    "discrete_equivalent": _discrete_equivalent,
}


def component(name: str, settings: Settings, step_size: float) -> Component:
    """The block `name` of `settings`. Raises FmuError where they give no component."""
    try:
        return BLOCKS[name](settings, step_size)
    except (ValueError, ArithmeticError) as error:
        raise FmuError(f"{name}: {error}") from error


def build_block(
    name: str,
    settings: Settings,
    room: Path,
    *,
    stop_time: float,
    step_size: float,
    packaging: Packaging = "python",
    platforms: Sequence[str] = (),
) -> Path:
    """The path of the block's FMU: in the cache, or made in `room` where the cache is off.

    settings holds the records of `components.specs` that the block is made of, by the names
    of a scene's tables; step_size (s) is its communication step. platforms are those of a native
    FMU, this machine's where none is named.
    """
    experiment = {"stop_time": stop_time, "step_size": step_size}

    def make(folder: Path) -> Path:
        from hapticlink.fmus.build import build, build_native

        made = component(name, settings, step_size)
        if packaging == "python":
            return build(made, folder, **experiment)
        return build_native(made, folder, platforms=platforms, **experiment)

    if cache.folder() is None:
        return make(room)
    material: dict[str, Any] = {
        "block": name,
        "settings": {k: asdict(v) if is_dataclass(v) else v for k, v in settings.items()},  # type: ignore[arg-type]
        **experiment,
    }
    if packaging == "native":
        from hapticlink.fmus.native.compiler import compiler_version, host_platform

        material["compiler"] = compiler_version()
        material["platforms"] = list(platforms) or [host_platform()]
    return cache.cached(material, make, room)
