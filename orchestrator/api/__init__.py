"""The functions of `import hapticlink`, which the commands call as well."""

from hapticlink.orchestrator.api.files import build as build
from hapticlink.orchestrator.api.files import export as export
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
from hapticlink.orchestrator.results.tables import Table as Table
from hapticlink.orchestrator.scene.scene import Scene as Scene
from hapticlink.orchestrator.stability.analysis import Stability as Stability
from hapticlink.orchestrator.stability.analysis import stability as stability
