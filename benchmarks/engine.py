"""A physics engine, MuJoCo, in the place of the graphics copy and of the mechanism.

Each scene runs with the graphics copy ours and MuJoCo's, placed on the mechanism's pose or pulled
by forces as in the report, at several rates; and with the mechanism ours and MuJoCo's, where links
meet walls and push objects. Compared are the distance of the operational point from the same scene
with our blocks, with the copy at the haptic rate, the energy generated at the user's
port, and how the run ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hapticlink as hl
from benchmarks.page import Progress, table
from hapticlink.orchestrator.base import temporary_folders
from studies import draw

SCENES = ("closed-loop-ideal", "two-users", "serial")
RATES = (10, 30, 60)
COPIES = {
    "ours, placed": ("exact", False),
    "MuJoCo, placed": ("exact", True),
    "ours, pulled": ("operational", False),
    "MuJoCo, pulled": ("operational", True),
}
CONTACTS = ("enclosure", "push-disc")
DURATION = 1.0
"""Of the copies' runs (s)."""


@dataclass(frozen=True)
class Ran:
    """What a run shows: path of the operational point (m), its times (s), energy generated at the
    user's port (J) at most, why it ended, and by how much objects moved (mm)."""

    time: np.ndarray
    path: np.ndarray
    energy: float | None
    end: str
    moved: dict[str, float]

    @property
    def energy_mj(self) -> str:
        return "-" if self.energy is None else f"{self.energy * 1e3:.3g} mJ"

    def off(self, other: Ran) -> float:
        """Largest distance (mm) from another run at the instants of both."""
        _, mine, its = np.intersect1d(
            np.round(self.time, 9), np.round(other.time, 9), return_indices=True
        )
        return float(np.linalg.norm(self.path[mine] - other.path[its], axis=1).max() * 1e3)


def ran(scene: str, options: list[str], block: str | None, folder: Path) -> Ran:
    swap = [f'fmu.+={{replaces="{block}", engine="mujoco"}}'] if block else []
    found = hl.run(scene, [*options, *swap], out=folder)
    rows, end = found.haptics, found.run["end"]
    linkage = hl.scene(scene).linkage
    assert linkage is not None
    moved, at = {}, 1
    for joint in linkage.joint:
        if joint.kind.free:
            way = np.column_stack([rows[f"virtual_mechanism.q[{at + i}]"] for i in (0, 1)])
            moved[joint.child] = float(np.linalg.norm(way - way[0], axis=1).max() * 1e3)
        at += joint.kind.size
    path = np.column_stack([rows[f"virtual_mechanism.x[{i}]"] for i in (1, 2)])
    energy = port.peak if (port := found.measures().port) else None
    why = "ended" if end["reason"] == "duration" else f"{end['reason']} at {end['time']:.2g} s"
    return Ran(rows["time"], path, energy, why, moved)


def copies(
    quick: bool, progress: Progress, room: Path
) -> dict[tuple[str, int, str], tuple[float, Ran]]:
    """By scene, rate and copy: the distance (mm) from the loop with our copy placed at the haptic
    rate, and the run."""
    scenes, rates = (SCENES[:1], RATES[1:2]) if quick else (SCENES, RATES)
    cases = [(s, r, c) for s in scenes for r in rates for c in COPIES]
    found, best = {}, {}
    for k, (scene, rate, name) in enumerate(cases):
        progress(f"engine: {scene}, {name}, {rate} Hz", k, len(cases))
        options = [f"duration={DURATION}"]
        if scene not in best:
            haptics = f"graphics.rate={hl.scene(scene).haptics.rate}"
            best[scene] = ran(scene, [*options, haptics], None, room / f"{scene}")
        sync, engine = COPIES[name]
        options += [f"graphics.rate={rate}", f"graphics.sync={sync}"]
        made = ran(scene, options, "virtual_environment" if engine else None, room / f"{k}")
        found[scene, rate, name] = made.off(best[scene]), made
    return found


def touching(quick: bool, progress: Progress, room: Path) -> dict[tuple[str, int, str], Ran]:
    """By scene, haptic rate and mechanism: contacts with walls and movable objects."""
    rates = (1024,) if quick else (512,)
    cases = [(s, r, m) for s in CONTACTS for r in rates for m in ("ours", "MuJoCo")]
    found = {}
    for k, (scene, rate, name) in enumerate(cases):
        progress(f"engine: {scene}, mechanism {name}, {rate} Hz", k, len(cases))
        options = ["contacts.detection=haptics", f"haptics.rate={rate}"]
        block = None if name == "ours" else "virtual_mechanism"
        found[scene, rate, name] = ran(scene, options, block, room / f"contact{k}")
    return found


def copies_table(found: dict[tuple[str, int, str], tuple[float, Ran]]) -> Iterator[str]:
    rows = (
        (scene, f"{rate} Hz", name, f"{off:.3g} mm", run.energy_mj, run.end)
        for (scene, rate, name), (off, run) in found.items()
    )
    return table("scene | graphics | copy | distance | energy at the port | end", "l" * 6, rows)


def contact_table(found: dict[tuple[str, int, str], Ran]) -> Iterator[str]:
    heads = "scene | haptics | mechanism | from ours | objects moved | energy at the port | end"
    rows = []
    for (scene, rate, name), run in found.items():
        off = f"{run.off(found[scene, rate, 'ours']):.3g} mm"
        moved = ", ".join(f"{body} {way:.1f} mm" for body, way in run.moved.items()) or "-"
        rows.append((scene, f"{rate} Hz", name, off, moved, run.energy_mj, run.end))
    return table(heads, "l" * 7, rows)


def spread(values: list[float]) -> str:
    return f"{np.median(values):.2g} mm ({min(values):.2g} to {max(values):.2g})"


def finding(found: dict[tuple[str, int, str], tuple[float, Ran]]) -> str:
    by = {c: [off for (_, _, name), (off, _) in found.items() if name == c] for c in COPIES}
    same, apart = (
        max(abs(a - b) for a, b in zip(by[f"MuJoCo, {how}"], by[f"ours, {how}"], strict=True))
        for how in ("placed", "pulled")
    )
    ends = [run.end for (_, _, name), (_, run) in found.items() if name == "MuJoCo, pulled"]
    return (
        f"With MuJoCo's copy placed on the mechanism's pose the loop differs from that with ours "
        f"by {same:.1g} mm; with both pulled by the report's forces, by {apart:.2g} mm. Distance "
        f"from the loop with graphics at the haptic rate (median and range over scenes and rates): "
        f"{spread(by['ours, placed'])} with a placed copy, {spread(by['ours, pulled'])} with ours "
        f"pulled, {spread(by['MuJoCo, pulled'])} with MuJoCo's pulled, of whose runs "
        f"{sum(end != 'ended' for end in ends)} of {len(ends)} end early."
    )


def figure(folder: Path, found: dict[tuple[str, int, str], tuple[float, Ran]]) -> None:
    """The distance by rate, one panel a scene."""
    scenes = list(dict.fromkeys(scene for scene, _, _ in found))
    drawn, panels = draw.panels(len(scenes), width=3.7, sharey=True)
    marks = dict(zip(COPIES, ("o-", "x--", "s-", "+--"), strict=True))
    for axes, scene in zip(panels, scenes, strict=True):
        for name, mark in marks.items():
            rows = [(r, off) for (s, r, n), (off, _) in found.items() if (s, n) == (scene, name)]
            axes.loglog(*zip(*rows, strict=True), mark, label=name, markersize=8)
        rates = sorted({rate for _, rate, _ in found})
        axes.set_xticks(rates, [str(rate) for rate in rates])
        axes.minorticks_off()
        axes.set(xlabel="graphics rate (Hz)", title=scene)
    panels[0].set_ylabel("distance from graphics at the haptic rate (mm)")
    panels[0].legend(fontsize="small")
    drawn.suptitle("The rate and the way a copy follows decide the error, not who computes it")
    draw.save(drawn, folder, "error.png")


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes error.png to `out`."""
    with temporary_folders.temporary_folder() as folder:
        found = copies(quick, progress, Path(folder))
        touched = touching(quick, progress, Path(folder))
    figure(out, found)
    page = [
        "# A physics engine in the place of our blocks\n",
        finding(found) + "\n",
        "![Distance by graphics rate](error.png)\n",
        f"Made by `{command}`: {len(found)} runs of {DURATION:g} s with the graphics copy ours or",
        f"MuJoCo's, {len(touched)} with the mechanism ours or MuJoCo's. How:",
        "[MuJoCo](../../docs/engine.md).\n",
        "## The graphics copy\n",
        "Largest distance of the operational point from the loop with our copy, placed, at the",
        "haptic rate; largest energy generated at the user's port.\n",
        *copies_table(found),
        "\n## The mechanism, with contacts\n",
        "Both detect contacts at the haptic rate; largest distance of the operational point from",
        "the run with our mechanism.\n",
        *contact_table(touched),
    ]
    return "\n".join(page) + "\n"
