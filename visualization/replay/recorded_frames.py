"""What a page shows of a recorded run: the frames of the live page, from the tables of its folder.

The frames are at the samples of the fastest table that has one of their signals; a slower signal
has its newest sample there, as the other blocks had it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.episodes import episodes
from hapticlink.analysis.findings.tracking import (
    find_users,
    newest,
    of_any_shape,
    of_block,
    table_of,
)
from hapticlink.analysis.findings.user_port import tolerated_energy, user_port
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import JOINT_COORDINATES, POINT_POSE, by_user
from hapticlink.orchestrator.results.read_results import Results, Vector, load
from hapticlink.orchestrator.results.recorded_scene import described_devices, scene_part
from hapticlink.visualization.mechanism.frame_signals import candidates
from hapticlink.visualization.mechanism.picture import PORT, Picture

PLACES = ("q", "x", "handle")
"""What a frame cannot be drawn without, of each user."""
NEEDED = (JOINT_COORDINATES, POINT_POSE)
MAX_FRAMES = 4000
"""Frames of a run; of longer ones every second, third, ... sample is shown."""
SIGNIFICANT_DIGITS = 7
"""Significant digits of the numbers of a frame."""


class Recorded:
    """A run of a linkage as frames: `times` (s), `frames`, `every` (samples to a frame, so that
    there are MAX_FRAMES at most), `missing`, the signals that the drawing would show and that are
    not recorded, and `left_out`, the number of frames whose poses are not finite.

    Raises InputFault for a folder without a run of a linkage, or without its poses."""

    def __init__(self, run: Results | Path | str) -> None:
        self.results = results = run if isinstance(run, Results) else load(run)
        self.name = folder = str(results.folder or results.record.scene["title"])
        linkage: Linkage | None = scene_part(results, "linkage", Linkage)
        if linkage is None:
            message = f"there is nothing to draw; `hapticlink report {folder}` has its figures"
            raise InputFault(f"{folder}: the run has no [linkage]: {message}")
        self.linkage = linkage
        device = scene_part(results, "device", Device)
        self.contacts: Contacts | None = scene_part(results, "contacts", Contacts)
        for signal, size in zip(
            NEEDED, (len(linkage.coordinate_units), linkage.space.size), strict=True
        ):
            table = of_block(results, signal, size)
            if table is None:
                message = "is not recorded: run the scene with record.signals = 'all'"
                raise InputFault(f"{folder}: {signal} {message}")
            if not len(table["time"]):
                raise InputFault(f"{folder}: the run ended before its first row")
        self.signals, self.missing = _choose_signals(results)
        tables = [t for s in self.signals.values() if (t := table_of(results, s))]
        fastest = max(tables, key=lambda table: len(table.rows))
        self.every = -(-len(fastest.rows) // MAX_FRAMES)
        self.times: Vector = fastest["time"][:: self.every]
        places = [v for k, v in self.values().items() if k.rpartition(".")[2] in PLACES]
        drawn = np.all([np.isfinite(v).all(axis=1) for v in places], axis=0)
        if not drawn.any():
            raise InputFault(f"{folder}: the run has no pose that is finite")
        self.times, self.left_out = self.times[drawn], int((~drawn).sum())
        self.users = [user.name for user in find_users(results)[1:]]
        others = scene_part(results, "devices", Mapping[str, Device]) if self.users else {}
        devices = by_user(device if "handle" in self.signals else None, others or {})
        described = described_devices(results)
        devices = {user: own for user, own in devices.items() if user in described}
        self.picture = Picture(linkage, devices, self.contacts)

    @property
    def period(self) -> float:
        """The time (s) between two frames, the median."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else 1.0

    def values(self) -> dict[str, NDArray[np.float64]]:
        """By name in a frame, the newest sample at each frame's time, (k, n)."""
        values = {}
        for key, signal in self.signals.items():
            table = table_of(self.results, signal)
            assert table
            if len(table["time"]):
                rows = newest(table, self.times)
                values[key] = table[signal][rows].reshape(len(rows), -1)
        return values

    def frames(self) -> list[dict[str, Any]]:
        """The frames as the live page gets them, without their time and what is not finite."""
        values, port = self.values(), user_port(self.results)
        energy = np.interp(self.times, port.time_s, port.generated_J) if port else None
        made = []
        for i in range(len(self.times)):
            row = {k: v[i].tolist() for k, v in values.items() if np.isfinite(v[i]).all()}
            frame = _by_user(row)
            if energy is not None and np.isfinite(energy[i]):
                frame["energy"] = {PORT: float(energy[i])}
            made.append(drawn := self.picture.drawn(frame))
            if energy is not None and port and energy[i] > tolerated_energy(port.hand_work_J):
                drawn["states"].append("energy")
        return made

    def message(self) -> dict[str, Any]:
        """All that the page needs, as JSON: the frames by name, each value with the frame from
        which on it stands."""
        frames = self.frames()
        keys = dict.fromkeys(key for frame in frames for key in frame)
        return {
            "title": self.results.record.scene["title"],
            "ending": summary.ending(self.results),
            "marks": [mark._asdict() for mark in self.picture.marks],
            "view": asdict(self.picture.view),
            "times": [_round(float(t)) for t in self.times],
            "every": self.every,
            "missing": self.missing,
            "left_out": self.left_out,
            "energies": [PORT],
            "users": ["", *self.users],
            "frames": {key: _changes([frame.get(key) for frame in frames]) for key in keys},
            "episodes": [e._asdict() for e in episodes(self.results)],
        }


def _by_user(values: dict[str, Any]) -> dict[str, Any]:
    """A frame in which `user.name` is a name of that one in `others`."""
    frame: dict[str, Any] = {}
    for key, value in values.items():
        user, _, name = key.rpartition(".")
        of = frame.setdefault("others", {}).setdefault(user, {}) if user else frame
        of[name] = value
    return frame


def _choose_signals(results: Results) -> tuple[dict[str, str], list[str]]:
    """The recorded signal of each name of a frame, and those that are not recorded although the
    scene has them. A signal that stands in for another one does so only where there is no other."""
    left_out = results.record.not_recorded
    signals, missing = dict[str, str](), list[str]()
    asked = candidates()
    for user in find_users(results)[1:]:
        asked |= {f"{user.name}.{key}": names for key, names in candidates(user.name).items()}
    for key, names in asked.items():
        for name in names:
            if name in left_out:
                missing.append(name)
                break
            if of_any_shape(results, name):
                signals[key] = name
                break
    return signals, missing


def _changes(values: Sequence[Any]) -> dict[str, list[Any]]:
    """The values that differ from the one before, and at which places they are."""
    at, kept = [0], [_round(values[0])]
    for i, value in enumerate(values):
        if value != values[at[-1]]:
            at.append(i)
            kept.append(_round(value))
    return {"at": at, "is": kept}


def _round(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}")
    if isinstance(value, dict):
        return {k: _round(v) for k, v in value.items()}
    return [_round(v) for v in value] if isinstance(value, list | tuple) else value
