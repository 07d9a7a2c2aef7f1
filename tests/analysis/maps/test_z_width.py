"""Z-width: limits against closed forms, and how they are told."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.maps import z_width
from hapticlink.analysis.stability import wall_limits
from hapticlink.analysis.sweep.job import jobs
from hapticlink.commands import stability
from hapticlink.orchestrator.base.signal_names import HANDLE_VELOCITY
from hapticlink.orchestrator.scene.overrides import write_options
from hapticlink.visualization.figures.z_width_figure import finding
from tests.analysis.stability.own_hand import DAMPED as WALL

M, D, T, QUANTUM, FRICTION = 0.3, 5.0, 1 / 512, 1e-4, 0.05
STIFFNESS, DAMPING = "fmu.wall.start.stiffness", "fmu.wall.start.damping"
SPRING: dict[str, Any] = {
    "hand": {
        "type": "spring",
        "stiffness": [300.0, 300.0, 1.0],
        "damping": [5.0, 5.0, 0.01],
        "target": [[0.0, 0.0445, 0.0148, -0.7878]],
    }
}
FIRST = f"{STIFFNESS}=1000"


def test_limits_are_those_of_the_closed_forms(tmp_path: Path) -> None:
    """The lifted map knows nothing of them; a search is told to a thousandth, on the side that
    holds."""
    rows = hl.z_width(
        "virtual-wall",
        FIRST,
        [f"{DAMPING}=0,2", f"delays.wall.F=0,{T}"],
        {**WALL, "fmu.wall.settings.quantum": QUANTUM, "linkage.joint.rail.friction": FRICTION},
        out=tmp_path,
        jobs=1,
    )
    assert len(rows) == 4
    for row in rows:
        B, periods = float(row[DAMPING]), round(float(row["delays.wall.F"]) / T)
        stable = wall_limits.stable(M, D, T, periods, B)
        assert (row["stable"], row["passive"]) == ("limit", "limit")
        assert 0.9985 * stable < row["largest_stable"] < 1.0001 * stable
        if not periods:
            passive = wall_limits.passive(D, T, B)
            assert 0.9985 * passive < row["largest_passive"] < 1.0005 * passive
        assert row["largest_without_cycles"] == max(0.0, 2 * (FRICTION / QUANTUM - B / T))
        # at the first stiffness, friction just holds the counts alone
        assert ("cycle_m" in row) == (B > 0)
    with (tmp_path / "z-width.csv").open(encoding="utf-8") as file:
        assert [row["stable"] for row in csv.DictReader(file)] == ["limit"] * 4
    assert (tmp_path / "z-width.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("limited", "value", "refused", "others", "kind"),
    [
        (True, 2.0, {}, True, "limit"),
        (False, 2.0, {}, False, "at least"),
        (True, 2.0, {2.0001: "diverges"}, False, "at least"),
        (True, 2.0, {4.0: "diverges"}, True, "limit"),
        (True, 0.0, {}, True, "none"),
        (True, 0.0, {1.0: "diverges"}, False, "refused"),
        (True, 0.0, {1.0: "diverges"}, True, "none"),
    ],
)
def test_what_is_told_of_a_search(
    limited: bool, value: float, refused: dict[float, str], others: bool, kind: str
) -> None:
    assert z_width._kind(z_width.Largest(value, limited), refused, others) == kind


def test_values_without_a_verdict_are_told_beside_those_that_have_one() -> None:
    """Nothing is stable, and the softest have no equilibrium."""

    def verdict(scale: float) -> str:
        if scale < 0.1:
            raise hl.InputFault("no equilibrium")
        return "unstable"

    row = z_width._largest("stable", 1000.0, verdict)
    assert (row["largest_stable"], row["stable"]) == (0.0, "none")
    assert row["message_stable"] == (
        "all that was tried is unstable; without a verdict: no equilibrium"
    )
    (line,) = stability._of_limits([row | {"a": 1}], ["a"])
    assert line == f"a=1: stable: {row['message_stable']}"


def test_a_search_without_any_verdict_finds_no_limit_of_none() -> None:
    def verdict(scale: float) -> str:
        raise hl.InputFault("no equilibrium")

    row = z_width._largest("stable", 1000.0, verdict)
    assert row["stable"] == "refused"
    (line,) = stability._of_limits([row | {"a": 1}], ["a"])
    assert line == "a=1: stable: without a verdict: no equilibrium"


@pytest.mark.parametrize(
    "first", ["stiffness", f"{STIFFNESS}=0", f"{STIFFNESS}=-3", f"{STIFFNESS}=[0.0, 1.0]", "a=no"]
)
def test_a_first_value_that_is_none_is_refused(first: str, tmp_path: Path) -> None:
    with pytest.raises(hl.InputFault, match="--largest"):
        hl.z_width("virtual-wall", first, ["haptics.rate=512"], WALL, out=tmp_path)


def test_limits_of_the_hold_passive_are_told_to_be_without_its_friction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are those of `zoh`, and a run beyond them stays bounded, which one with `zoh` does
    not. A coupling is scaled as a whole, and half the graphics rate bears less."""
    monkeypatch.setattr(z_width, "FINE", 0.3)
    options: dict[str, Any] = {**SPRING, "controller.teleoperation.damping": [5.0, 5.0, 0.005]}
    key, values = "controller.teleoperation.stiffness", [100.0, 100.0, 0.1]
    begun = write_options({**options, key: values, "graphics.rate": 32})
    points = [{"hold": "zoh"}, {"hold": "passive"}, {"hold": "zoh", "graphics.rate": "64"}]
    made = jobs("closed-loop-direct", begun, points)
    rows = [z_width._judge(job, tmp_path, key, values) for job in made]
    assert 0 < rows[0]["largest_stable"] < rows.pop()["largest_stable"]
    assert rows[0]["largest_stable"] == rows[1]["largest_stable"]
    assert "judged_without" not in rows[0]
    assert "the friction of hold passive" in rows[1]["judged_without"]
    *_, line = stability._of_limits(rows, [])
    assert line.endswith("the friction of hold passive, taken out")
    K = 1.5 * rows[0]["largest_stable"]
    options |= {"controller.teleoperation.stiffness": [K, K, 1e-3 * K], "graphics.rate": 32}
    moved = {**SPRING["hand"], "target": [[0.0, 0.0446, 0.0149, -0.7868]]}
    ends = {
        hold: np.abs(
            hl.run(
                "closed-loop-direct",
                {**options, "hold": hold, "hand": moved, "duration": 10.0, "stop_when": ""},
                figures=False,
            )[HANDLE_VELOCITY][-512:]
        ).max()
        for hold in ("zoh", "passive")
    }
    assert ends["passive"] < 0.01 < ends["zoh"]


def test_where_nothing_is_stable_the_verdicts_are_told(tmp_path: Path) -> None:
    """Damping by differences of B T > 2 m alone turns the velocity over at each step: no stiffness
    helps."""
    options = {**WALL, STIFFNESS: 1000.0, DAMPING: 500, "delays.wall.F": T}
    (job,) = jobs("virtual-wall", write_options(options), [{}])
    row = z_width._judge(job, tmp_path, STIFFNESS, 1000.0)
    assert (row["largest_stable"], row["stable"]) == (0.0, "none")
    assert row["message_stable"] == "all that was tried is unstable"


def test_a_figure_says_what_was_found() -> None:
    rows = [
        {"haptics.rate": rate, "stable": kind, "largest_stable": value}
        for rate, kind, value in (
            (256, "none", 0.0),
            (512, "limit", 1021.3),
            (1024, "limit", 2050.0),
        )
    ]
    assert finding(rows, ["haptics.rate"]) == (
        "Stable up to 1020 at rate of the haptic loop = 512 Hz; up to 2050 at rate of the haptic "
        "loop = 1024 Hz; nothing stable found at 1 of 3 points"
    )
    rows[2]["stable"] = "at least"
    assert "; at least up to 2050 at " in finding(rows, ["haptics.rate"])
    assert finding(rows[1:2], ["haptics.rate"]) == (
        "Stable up to 1020 at rate of the haptic loop = 512 Hz"
    )
    assert finding(rows[:1], ["haptics.rate"]) == "Nothing stable found at 1 of 1 points"
