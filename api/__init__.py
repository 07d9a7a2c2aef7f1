"""Haptic rendering of linkages: FMUs, co-simulated at separate rates.

    import hapticlink as hl

    r = hl.run("closed-loop", {"graphics.rate": 10})
    r["virtual_mechanism.x"], r.time("virtual_mechanism.x")

Scenes: `shipped`, `scene`, `explain`. Runs: `run`, `RealTime`, `sweep`, `load`.
Files: `build`, `export`. Before a hand is on the device: `stability`, `tune`.
Raised: `InputFault` for bad input, with all findings of a scene `SceneFault`; each is a `Fault`.
"""

# In a checkout this file is `api/__init__.py`; installed, it is the package's own.

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hapticlink.orchestrator.api import (
        Fault,
        InputFault,
        Map,
        Passivity,
        RealTime,
        Run,
        RunInterrupted,
        Scene,
        SceneFault,
        Stability,
        Sweep,
        Table,
        Tuned,
        VaryingStability,
        build,
        explain,
        export,
        finite_time_growth,
        load,
        passivity,
        run,
        scene,
        shipped,
        stability,
        stability_map,
        sweep,
        tune,
    )

    __version__: str
else:

    def __getattr__(name: str) -> Any:
        """Loads what is behind a name when it is first used: `hapticlink --help` needs none."""
        if name == "__version__":
            from importlib.metadata import version

            return version("hapticlink")
        if name not in __all__:
            raise AttributeError(f"module 'hapticlink' has no attribute {name!r}")
        from hapticlink.orchestrator import api

        return getattr(api, name)


__all__ = [
    "Fault",
    "InputFault",
    "Map",
    "Passivity",
    "RealTime",
    "Run",
    "RunInterrupted",
    "Scene",
    "SceneFault",
    "Stability",
    "Sweep",
    "Table",
    "Tuned",
    "VaryingStability",
    "__version__",
    "build",
    "explain",
    "export",
    "finite_time_growth",
    "load",
    "passivity",
    "run",
    "scene",
    "shipped",
    "stability",
    "stability_map",
    "sweep",
    "tune",
]


def __dir__() -> list[str]:
    return __all__
