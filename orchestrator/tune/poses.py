"""Where gains are judged: the scene's start, where joints constrain the handle, and the contact
that presses hardest in its run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.linkage.parameters import COORDINATES, mean_link_length
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.results.tracking import DEVICE, MECHANISM, table_of
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.tune.held import spring

CONTACT, MOBILITY = "virtual_mechanism.F_env", "Lambda_inv"
FIRM = 1000.0
"""Stiffness (N/m) of the hand with which a pose is found."""
CONSTRAINED = 1e-6
"""Of the largest scaled mobility, up to which a direction does not move."""


@dataclass(frozen=True)
class Pose:
    """A pose of the mechanism by joint, of the handle, the wrench with which the hand presses, and
    the wrench n along which stiffness is felt, with a unit force, or a unit torque without any."""

    name: str
    joints: dict[str, float | list[float]]
    handle: tuple[float, ...]
    press: tuple[float, ...]
    along: tuple[float, ...]

    def options(self, given: Sequence[str]) -> tuple[str, ...]:
        """The options of the scene at rest in this pose, in a spring hand."""
        rest: dict[str, Any] = {"hand": spring(self.handle, self.press, FIRM)}
        if self.name == "contact":
            rest |= {"linkage.start": self.joints, "linkage.start_velocity": {}}
        return (*given, *overrides.written(rest))


def poses(scene: str | Path, options: Sequence[str]) -> tuple[Pose, ...]:
    """The poses of a scene, which is run. Raises InputFault where it has no handle, and where
    neither a joint constrains it nor anything touches."""
    with temporary_folders.room() as room:
        read = open_scene.load(scene, options)
        if read.linkage is None or read.controller is None or read.device is None:
            raise InputFault(
                "a linkage, a [device] and a [controller] are needed: no gains to tune"
            )
        made = simulate(scene, room, tuple(options))
        if made.outcome.fault and not len(made.results.tables):
            raise InputFault(
                f"the run in which a contact is looked for fails: {made.outcome.fault}"
            )
        results = made.results
        found = []
        handle = _vector(results, DEVICE)
        n = _constrained(results, mean_link_length(read.linkage))
        if n is not None:
            start = tuple(handle[0].tolist())
            found.append(Pose("constraint", {}, start, (0.0, 0.0, 0.0), tuple(n.tolist())))
        contact = table_of(results, CONTACT)
        if contact is not None and read.contacts is not None:
            force = contact[CONTACT]
            at = int(np.argmax(np.hypot(force[:, 0], force[:, 1])))
            if (size := float(np.hypot(*force[at, :2]))) > 0.0:
                q = contact["virtual_mechanism.q"][at]
                x = contact[MECHANISM][at]
                found.append(
                    Pose(
                        "contact",
                        _by_joint(read.linkage, q),
                        tuple(x.tolist()),
                        tuple((-force[at]).tolist()),
                        tuple((force[at] / size).tolist()),
                    )
                )
    if not found:
        raise InputFault(
            "no direction of the handle is constrained and no contact was met in the run"
        )
    return tuple(found)


def _vector(results: Results, signal: str) -> NDArray[np.float64]:
    table = table_of(results, signal)
    if table is None or not len(table["time"]):
        raise InputFault(f"{signal} is not recorded: it is needed to find a pose")
    found: NDArray[np.float64] = table[signal]
    return found


def _constrained(results: Results, length: float) -> NDArray[np.float64] | None:
    """The wrench that no motion answers at the start, None where there is none; of several, that
    with the largest force."""
    blocks = ("virtual_environment", "virtual_mechanism")
    tables = [(f"{b}.{MOBILITY}", table_of(results, f"{b}.{MOBILITY}")) for b in blocks]
    held = next(((name, t) for name, t in tables if t is not None), None)
    if held is None:
        return None
    S = np.diag([1.0, 1.0, length])
    values, vectors = np.linalg.eigh(S @ held[1][held[0]][0] @ S)
    null = [S @ vectors[:, i] for i in range(3) if values[i] < CONSTRAINED * values[-1]]
    if not null:
        return None
    n = max(null, key=lambda wrench: float(np.hypot(*wrench[:2])))
    size = float(np.hypot(*n[:2]))
    found: NDArray[np.float64] = n / size if size > 1e-6 else n / abs(n[2])
    return found


def _by_joint(linkage: Any, q: NDArray[np.float64]) -> dict[str, float | list[float]]:
    found: dict[str, float | list[float]] = {}
    at = 0
    for joint in linkage.joint:
        size = COORDINATES[joint.type]
        values = [float(v) for v in q[at : at + size]]
        found[joint.name] = values if size > 1 else values[0]
        at += size
    return found
