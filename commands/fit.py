from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hapticlink.commands.options import PRINTED, Output, Set, default_folder
from hapticlink.commands.progress import waiting
from hapticlink.orchestrator.base.errors import InputFault

if TYPE_CHECKING:
    from hapticlink.analysis.fit.kinematics import FittedKinematics

Log = Annotated[Path, Parameter(help="CSV or HDF5 file, or the folder of a run.")]
OfScene = Annotated[str, Parameter(help="Scene whose device and hand are assumed.")]
Fitted = Annotated[
    str | None,
    Parameter(help="Keys of [device] to fit, key,key,...; by default of handle and friction."),
]

Kinematics = Annotated[
    bool,
    Parameter(
        negative="",
        help="Fit lengths, and offsets of encoders, to the angles of the log and, where it has "
        "them, to known places of the handle.",
    ),
]
Known = Annotated[
    str | None,
    Parameter(help="With --kinematics: parameters that are not searched, name,name,..."),
]


def fit(
    log: Log,
    /,
    *,
    scene: OfScene = "closed-loop",
    device: Fitted = None,
    kinematics: Kinematics = False,
    known: Known = None,
    set: Set = None,
    output: Output = PRINTED,
) -> int:
    """Fit a device, and the arm that holds it, to a log of its encoders and forces.

    Prints each parameter with its standard deviation. Writes fit.json, and fitted.toml with the
    tables [device] and [hand] of a scene, to OUT (default `fits/LOG`). What the log must have:
    docs/fit.md.

    For example:

        hapticlink fit runs/moved --kinematics --scene my-kit.toml --known left.at_parent
        hapticlink fit shaken.csv --device body.crank.mass,motor.friction
    """
    from hapticlink.analysis.fit.fit import Fitted as FittedScene
    from hapticlink.analysis.fit.fit import fit as fitted
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.write_files import write_json

    if known and not kinematics:
        raise InputFault("--known: it is of --kinematics: give that, or leave it out")
    options, files = tuple(set or ()), "fit.json"
    result: FittedScene | FittedKinematics
    if kinematics:
        result = _fit_kinematics(log, scene, options, known.split(",") if known else ())
    else:
        names = tuple(device.split(",")) if device else ()
        what = f"{log.name}: fitting, which takes seconds for each second of it"
        with waiting(what, output.quiet):
            result = fitted(log, scene, options, device=names)
    folder = folders.ensure(output.out or default_folder("fits", log.stem))
    write_json(folder / "fit.json", result.record())
    if isinstance(result, FittedScene):
        (folder / "fitted.toml").write_text(result.scene(), encoding="utf-8")
        files = "fitted.toml, fit.json"
    output.show(f"{log.name}:", (*result.lines(), f"{folder}/: {files}"), result.record())
    return 0


def _fit_kinematics(
    log: Path, scene: str, options: Sequence[str], known: Sequence[str]
) -> FittedKinematics:
    import hapticlink as hl
    from hapticlink.analysis.fit.kinematics import fit_kinematics, read_angles

    device = hl.scene(scene, options).device
    if device is None:
        raise InputFault("fit: the scene has no [device]")
    return fit_kinematics(device, *read_angles(log, device), known=known)
