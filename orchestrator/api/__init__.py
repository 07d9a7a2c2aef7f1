"""The functions of `import hapticlink`, which the commands call as well; each is loaded when it is
first used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hapticlink.orchestrator.api.files import build as build
    from hapticlink.orchestrator.api.files import export as export
    from hapticlink.orchestrator.api.maps import stability_map as stability_map
    from hapticlink.orchestrator.api.real_time import RealTime as RealTime
    from hapticlink.orchestrator.api.result import Run as Run
    from hapticlink.orchestrator.api.runs import RunInterrupted as RunInterrupted
    from hapticlink.orchestrator.api.runs import load as load
    from hapticlink.orchestrator.api.runs import run as run
    from hapticlink.orchestrator.api.scenes import explain as explain
    from hapticlink.orchestrator.api.scenes import scene as scene
    from hapticlink.orchestrator.api.scenes import shipped as shipped
    from hapticlink.orchestrator.api.sweeps import Sweep as Sweep
    from hapticlink.orchestrator.api.sweeps import sweep as sweep
    from hapticlink.orchestrator.base.faults import Fault as Fault
    from hapticlink.orchestrator.base.faults import InputFault as InputFault
    from hapticlink.orchestrator.base.faults import SceneFault as SceneFault
    from hapticlink.orchestrator.maps import Map as Map
    from hapticlink.orchestrator.results.tables import Table as Table
    from hapticlink.orchestrator.scene.scene import Scene as Scene
    from hapticlink.orchestrator.stability.analysis import Stability as Stability
    from hapticlink.orchestrator.stability.analysis import stability as stability
    from hapticlink.orchestrator.stability.finite_time import (
        finite_time_growth as finite_time_growth,
    )
    from hapticlink.orchestrator.stability.passivity import Passivity as Passivity
    from hapticlink.orchestrator.stability.passivity import passivity as passivity
    from hapticlink.orchestrator.stability.varying import VaryingStability as VaryingStability
    from hapticlink.orchestrator.tune import Tuned as Tuned
    from hapticlink.orchestrator.tune import tune as tune
else:

    def __getattr__(name: str) -> Any:
        match name:
            case "build" | "export":
                from hapticlink.orchestrator.api import files as room
            case "RealTime":
                from hapticlink.orchestrator.api import real_time as room
            case "Run":
                from hapticlink.orchestrator.api import result as room
            case "run" | "load" | "RunInterrupted":
                from hapticlink.orchestrator.api import runs as room
            case "scene" | "explain" | "shipped":
                from hapticlink.orchestrator.api import scenes as room
            case "sweep" | "Sweep":
                from hapticlink.orchestrator.api import sweeps as room
            case "Fault" | "InputFault" | "SceneFault":
                from hapticlink.orchestrator.base import faults as room
            case "Table":
                from hapticlink.orchestrator.results import tables as room
            case "Scene":
                from hapticlink.orchestrator.scene import scene as room
            case "stability" | "Stability":
                from hapticlink.orchestrator.stability import analysis as room
            case "VaryingStability":
                from hapticlink.orchestrator.stability import varying as room
            case "finite_time_growth":
                from hapticlink.orchestrator.stability import finite_time as room
            case "passivity" | "Passivity":
                from hapticlink.orchestrator.stability import passivity as room
            case "tune" | "Tuned":
                from hapticlink.orchestrator import tune as room
            case "stability_map":
                from hapticlink.orchestrator.api import maps as room
            case "Map":
                from hapticlink.orchestrator import maps as room
            case _:
                raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(room, name)
