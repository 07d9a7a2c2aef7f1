# The public names of hapticlink and the modules that define them: the one list of them.

from hapticlink.analysis.fit.fit import Fitted as Fitted
from hapticlink.analysis.fit.fit import fit as fit
from hapticlink.analysis.maps.stability_map import Map as Map
from hapticlink.analysis.stability.judge_scene import (
    equilibrium_stability as equilibrium_stability,
)
from hapticlink.analysis.stability.judge_scene import stability as stability
from hapticlink.analysis.stability.passivity import Passivity as Passivity
from hapticlink.analysis.stability.passivity import passivity as passivity
from hapticlink.analysis.stability.varying_rate import VaryingStability as VaryingStability
from hapticlink.analysis.stability.verdict_record import Stability as Stability
from hapticlink.analysis.transparency.mobility_at_hand import Transparency as Transparency
from hapticlink.analysis.transparency.mobility_at_hand import transparency as transparency
from hapticlink.analysis.tune.tune_gains import Tuned as Tuned
from hapticlink.analysis.tune.tune_gains import tune as tune
from hapticlink.api.compare import Comparison as Comparison
from hapticlink.api.compare import compare as compare
from hapticlink.api.files import build as build
from hapticlink.api.files import export as export
from hapticlink.api.maps import stability_map as stability_map
from hapticlink.api.maps import z_width as z_width
from hapticlink.api.real_time import RealTime as RealTime
from hapticlink.api.replay import Replay as Replay
from hapticlink.api.replay import view as view
from hapticlink.api.result import Run as Run
from hapticlink.api.runs import RunInterrupted as RunInterrupted
from hapticlink.api.runs import load as load
from hapticlink.api.runs import run as run
from hapticlink.api.scenes import explain as explain
from hapticlink.api.scenes import scene as scene
from hapticlink.api.scenes import shipped as shipped
from hapticlink.api.sweeps import Sweep as Sweep
from hapticlink.api.sweeps import sweep as sweep
from hapticlink.api.trials import Trials as Trials
from hapticlink.api.trials import trial as trial
from hapticlink.orchestrator.base.errors import Fault as Fault
from hapticlink.orchestrator.base.errors import InputFault as InputFault
from hapticlink.orchestrator.base.errors import SceneFault as SceneFault
from hapticlink.orchestrator.results.read_results import Table as Table
from hapticlink.orchestrator.scene.scene import Scene as Scene

__all__: list[str]
__version__: str
