"""Holds with parameters: a hold of a plugin whose constructor has arguments besides the context."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.holds import HOLDS, Hold
from hapticlink.orchestrator.scene.hold_tables import read_hold
from tests.orchestrator.wall_clock import WallClock
from tests.plugins import hapticlink

ROOT = Path(__file__).parents[3]
Share = Annotated[float, Quantity("1", ge=0, le=1)]


class Weighted(Hold):
    """y_n + weight (y_n - y_{n-1}) + offset: 0 and 0 are zoh, 1/2 and 0 lead at one period."""

    def __init__(self, context, weight: Share, offsets: tuple[float, ...] = ()):
        self.weight, self.offset = weight, sum(offsets)
        self.samples: list[np.ndarray] = []
        self.at = -1

    def push(self, described, sample, arrival):
        if described == self.at:
            self.samples.pop()
        self.samples, self.at = [*self.samples[-1:], sample.copy()], described

    def value(self, tick, ahead=0.0):
        newest, before = self.samples[-1], self.samples[0]
        return newest + self.weight * (newest - before) + self.offset


@pytest.fixture(autouse=True)
def plugin(monkeypatch):
    monkeypatch.setitem(HOLDS, "weighted", Weighted)


SIGNAL = "virtual_mechanism.x -> controller.x_S"
SHORT = {"duration": 0.2, "mechanism_at": "graphics", "haptics.rate": 256, "graphics.rate": 32}


def run(options):
    return hl.run("single-body", SHORT | options, figures=False)


@pytest.mark.parametrize(
    ("given", "name", "same"),
    [
        ({"type": "weighted", "weight": 0}, "weighted(weight=0.0)", "zoh"),
        ({"type": "weighted", "weight": 0.5}, "weighted(weight=0.5)", "lead"),
        ("weighted(weight=0.5)", "weighted(weight=0.5)", "lead"),
        ({"type": "foh"}, "foh", "foh"),
    ],
)
def test_parameters_reach_the_hold_wherever_a_hold_is_named(given, name, same):
    wanted = run({"holds": {SIGNAL: same}})
    found = run({"holds": {SIGNAL: given}})
    assert found.run["holds"][SIGNAL] == name
    plan = hl.explain("single-body", SHORT | {"holds": {SIGNAL: given}})
    assert any(SIGNAL in line and name in line for line in plan)
    for column in wanted.haptics.columns:
        np.testing.assert_array_equal(found.haptics[column], wanted.haptics[column])


def test_a_default_hold_and_a_list(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'extends = "single-body"\nhold = { type = "weighted", weight = 0.25, offsets = [0, 0.0] }\n'
    )
    found = hl.run(path, SHORT | {"holds": {"virtual_environment.Lambda_inv": "zoh"}})
    assert found.run["holds"][SIGNAL] == "weighted(weight=0.25, offsets=[0.0, 0.0])"
    assert HOLDS[found.run["holds"][SIGNAL]](None).offset == 0.0
    again = hl.scene(hl.scene(path, {"duration": 0.1}), {"duration": 0.2})  # its own name is read
    assert again.hold == "weighted(weight=0.25, offsets=[0.0, 0.0])"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('hold = { type = "weighted" }', "line 2: hold.weight: is missing"),
        ('hold = "weighted"', "line 2: hold.weight: is missing"),
        (
            'hold = { type = "weighted", weight = 2 }',
            "line 2: hold.weight: 2 is out of range: give",
        ),
        ('hold = { type = "weighted", wieght = 1, weight = 1 }', "did you mean 'weight'?"),
        ('hold = { type = "foh", weight = 1 }', "line 2: hold.weight: unknown key"),
        ("hold = { weight = 1 }", "line 2: hold.type: is missing: which hold is it?"),
        ('hold = "weighted(weight=)"', "line 2: hold: weighted(weight=): Invalid value"),
        ('[holds]\n"hand.F" = { type = "weigthed" }', "did you mean 'weighted'?"),
        (
            '[[connection]]\nfrom = "hand.F"\nto = "virtual_mechanism.F_hand"\n'
            'hold = { type = "weighted", weight = "a" }',
            "line 5: connection[0].hold.weight: 'a' should be",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, line, message):
    path = tmp_path / "mine.toml"
    path.write_text(f'extends = "single-body"\n{line}\n')
    with pytest.raises(InputFault) as refused:
        hl.scene(path)
    assert message in str(refused.value)


PLUGIN = """
from tests.orchestrator.scene.test_hold_tables import Weighted
from hapticlink.orchestrator.holds import HOLDS
HOLDS.register("weighted", Weighted)
"""


def test_they_are_swept(tmp_path):
    """In processes of their own, which load the plugin."""
    (tmp_path / "weighs.py").write_text(f"import sys\nsys.path.append({str(ROOT)!r})\n{PLUGIN}")
    (tmp_path / "mine.toml").write_text(
        'extends = "single-body"\nduration = 0.2\nmechanism_at = "graphics"\nhaptics.rate = 256\n'
        f'graphics.rate = 32\n[holds]\n"{SIGNAL}" = {{ type = "weighted", weight = 0.0 }}\n'
    )
    line = f"hapticlink sweep mine.toml --plugin weighs --vary 'holds.\"{SIGNAL}\".weight=0.0,0.5'"
    (ended,) = hapticlink(tmp_path, f"{line} --json --quiet --jobs 1 --out swept", path=tmp_path)
    assert ended.status == 0, ended.said
    rows = json.loads(ended.said)["rows"]
    alone = [
        run({"holds": {SIGNAL: hold}}).tracking().distance_mm.max() for hold in ("zoh", "lead")
    ]
    assert [row["tracking_max_mm"] for row in rows] == alone
    assert alone[0] != alone[1]


def test_they_can_be_given_while_a_scene_runs():
    live, clock = hl.RealTime("single-body", SHORT), WallClock()
    live._schedule = clock.run

    def turn(live):
        live.hold(SIGNAL, "weighted(weight=0.5)")
        with pytest.raises(InputFault, match="weight: Input should be"):
            live.hold(SIGNAL, "weighted(weight=7)")
        live.stop()

    assert (
        live.run(turn).run["real_time"]["changes"][0][1].startswith(f"hold of {SIGNAL}: weighted")
    )


def test_a_name_with_parameters_is_read_as_a_table():
    assert read_hold("weighted(weight=1)") == "weighted(weight=1.0)"
    assert read_hold("foh") == "foh"
    with pytest.raises(InputFault, match="no hold 'fo'"):
        read_hold("fo")


def test_an_ssp_keeps_them(tmp_path):
    hold = {"holds": {SIGNAL: {"type": "weighted", "weight": 0.5}}}
    hl.export("single-body", SHORT | hold, out=tmp_path / "body.ssp")
    assert hl.run(tmp_path / "body.ssp").run["holds"][SIGNAL] == "weighted(weight=0.5)"


def test_a_state_goes_on_with_another_parameter(tmp_path):
    first = SHORT | {"hold": {"type": "weighted", "weight": 0.5}}
    hl.run("single-body", first, out=tmp_path / "a", save=[0.125], figures=False)
    state = tmp_path / "a" / "at-0.125.state"
    names = [hl.run(state, {"hold.weight": w}, figures=False).run["holds"] for w in (0.5, 0.25)]
    assert [name[SIGNAL] for name in names] == ["weighted(weight=0.5)", "weighted(weight=0.25)"]
