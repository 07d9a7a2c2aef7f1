"""Warnings of a run: contacts that the hand does not feel, friction that steps do not resolve."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.summary import describe_generated
from tests.little_fmus import entries, slave


@pytest.mark.parametrize(
    ("peak", "end", "said"),
    [
        (4e-4, -2e-4, "generated at most 0.4 mJ, and by the end has dissipated 0.2 mJ"),
        (4e-4, 2e-4, "generated at most 0.4 mJ, and by the end has generated 0.2 mJ"),
        (4e-4, 4e-4, "generated 0.4 mJ by the end, and at no time more"),
        (0.0, -2e-4, "generated no energy and dissipated 0.2 mJ"),
        (3e-17, -2.69e-2, "generated no energy and dissipated 26.9 mJ"),
        (0.0, 0.0, "generated no energy"),
    ],
)
def test_energy_that_was_generated_in_words(peak: float, end: float, said: str) -> None:
    assert describe_generated(peak, end) == said


def warned(options: dict[str, object]) -> list[str]:
    made = hl.run("obstacles", {"duration": 0.6, **options})
    return [line for line in made.run["warnings"] if "controller.contact = true" in line]


def test_contacts_without_a_controller_that_renders_them() -> None:
    (line,) = warned({"controller.contact": False})
    assert "contacts act on the mechanism from 0." in line


@pytest.mark.parametrize(
    "options",
    [{}, {"controller.contact": False, "duration": 0.01}],
    ids=["rendered", "nothing is touched"],
)
def test_no_warning_without_cause(options: dict[str, object]) -> None:
    assert not warned(options)


SLIDER = {
    "duration": 1.4,
    "haptics.rate": 128,
    "linkage.body.bar.mass": 0.5,
    "linkage.start.slide": 0.103,
    "linkage.start_velocity.slide": 0.0,
    "linkage.joint.slide.stiffness": 200.0,
    "linkage.joint.slide.friction": 1.0,
}


def slid(t: np.ndarray) -> np.ndarray:
    """The rate (m/s) of a slider whose friction f stops its spring k: half cycles about f/k = 0.005
    m on alternating sides, each of an amplitude 2 f/k smaller."""
    turns = np.floor(20 * t / np.pi)
    return -20 * (0.098 - 0.01 * turns) * np.sin(20 * t)


@pytest.mark.parametrize(("substeps", "low", "high"), [(1, 0.02, 0.2), (16, 0.0, 0.005)])
def test_turns_that_cost_the_rate_are_told(
    bar: Path, substeps: int, low: float, high: float
) -> None:
    run = hl.run(bar, SLIDER | {"mechanism.substeps": substeps})
    assert run.run["friction_speeds"] == {"slide": pytest.approx(4 * 1.0 / 0.5 / 128 / substeps)}
    table = run["haptics"]
    exact = slid(table["time"])
    error = np.abs(table["virtual_mechanism.qd"][:, 0] - exact).max() / np.abs(exact).max()
    assert low < error < high
    told = [line for line in run.run["warnings"] if "friction of slide" in line]
    assert len(told) == (substeps == 1)


SPRING = {"type": "spring", "stiffness": [10, 10, 0.1], "damping": [1, 1, 0.01]}
AT_START = [0.0, 0.0445, 0.0148]
FREEZE = {"freeze": ["controller.F_hand"], "time": 0.3}
SINE = {"amplitude": [1e-4, 0.0, 0.0], "frequency": [2.0, 2.0, 2.0]}
NOWHERE = [
    ({"hold": "foh", "graphics.rate": 512}, "acts on no connection: there is no connection from a"),
    ({"hold": "foh", "holds.controller.Lambda_inv": "zoh", "holds.controller.P_c": "zoh"}, "have"),
    ({"at": [{**FREEZE, "until": 0.30001}]}, "on, acts on no step: the first one is at"),
    ({"at": [{**FREEZE, "time": 9.0}]}, "frozen, from 9 s on, acts on no step: none begins before"),
    (
        {"at": [{"freeze": ["virtual_environment.q_ref"], "time": 0.49}]},
        "q_ref frozen, from 0.49 s",
    ),
]
SOMEWHERE = [
    {"hold": "foh"},
    {"at": [{**FREEZE, "until": 0.301}]},
]
SAID = "acts on no"


@pytest.mark.parametrize(("options", "said"), NOWHERE)
def test_what_acts_nowhere_is_said(options, said):
    run = hl.run("closed-loop-ideal", {"duration": 0.5, **options})
    assert any(said in line and re.search(SAID, line) for line in run.run["warnings"])


@pytest.mark.parametrize("options", SOMEWHERE)
def test_what_acts_is_not(options):
    run = hl.run("closed-loop-ideal", {"duration": 0.5, **options})
    assert not [line for line in run.run["warnings"] if re.search(SAID, line)]


def test_a_device_that_starts_elsewhere_is_said(tmp_path):
    """A handle that nobody moves, 16 mm from the operational point."""
    pose = [0.044522, 0.030797, -0.7878]
    at = {f"{name}[{i + 1}]": pose[i] for name in ("x", "x_true") for i in range(3)}
    mass = {f"M[{i},{k}]": float(i == k) for i in (1, 2, 3) for k in (1, 2, 3)}
    slave(tmp_path, "Fixed", ("output", {**at, **entries("v", 3), **mass, **entries("c", 3)}))
    own = {"path": str(tmp_path / "Fixed.fmu"), "replaces": "haptic_device"}
    run = hl.run("closed-loop-ideal", {"duration": 0.05, "stop_when": "", "fmu": [own]})
    (line,) = [w for w in run.run["warnings"] if "from the operational point: errors" in w]
    assert line.startswith("warning: the handle starts 16 mm and")


def pushed_against_a_wall(folder: Path, force: float, rate: float, **contacts: str) -> hl.Run:
    """A ball of 0.5 kg at rest, 46 mm before a wall of 30 mm, from t = 0 on under a force (N)."""
    scene = folder / "pushed.toml"
    scene.write_text(f"""
title = "Pushed against a wall"
duration = 0.3
haptics.rate = 512
graphics.rate = {rate}

[hand]
wrench = [{force}, 0.0, 0.0]

[linkage.operational_point]
body = "ball"

[[linkage.body]]
name = "ball"
mass = 0.5
inertia = 1e-4
radius = 0.004

[[linkage.joint]]
name = "slide"
type = "prismatic"
axis = 0.0
child = "ball"

[contacts]
damping = 0.0

[[contacts.polygon]]
name = "wall"
corners = [[0.05, -0.1], [0.08, -0.1], [0.08, 0.1], [0.05, 0.1]]
""")
    options = {f"contacts.{key}": value for key, value in contacts.items()}
    return hl.run(scene, options)


def test_a_contact_that_was_met_late_is_told_with_the_energy_that_its_frame_gave(
    tmp_path: Path,
) -> None:
    """40 m/s^2, more than held contacts foresee. Energy: E - E(0) = F dx + what frames gave."""
    made = pushed_against_a_wall(tmp_path, 20.0, 30)
    held, warned = made.run["held_contacts"], "\n".join(made.run["warnings"])
    rows = made.tables["haptics"]
    x, energy = rows["virtual_mechanism.x"][:, 0], rows["virtual_mechanism.energy"]
    gained = energy[-1] - energy[0] - 20.0 * (x[-1] - x[0])
    assert held["given"] > 1.0
    assert gained == pytest.approx(held["given"] - held["taken"], rel=1e-3)
    assert held["largest_jump"] > 100.0
    assert "no contact that is held from an earlier frame touches it there" in warned
    assert f"frame of contacts at {held['time_of_gain']:.4g} s gave the mechanism" in warned
    jumps = [line for line in made.numbers or () if "a new frame F_env jumps by at most" in line]
    assert len(jumps) == 1


def test_what_is_not_checked_of_held_contacts_is_said(tmp_path: Path) -> None:
    pushed_against_a_wall(tmp_path, 20.0, 30)
    said = "what new frames of contacts gave the mechanism is not checked"
    for options in ({"record.every": 2}, {"delays.virtual_environment.contacts": 0.001}):
        made = hl.run(tmp_path / "pushed.toml", options)
        assert "held_contacts" not in made.run
        assert any(said in line for line in made.run["warnings"])
    assert not any(said in line for line in hl.run(tmp_path / "pushed.toml").run["warnings"])


@pytest.mark.parametrize(
    ("force", "contacts"), [(5.0, {}), (20.0, {"detection": "haptics"})], ids=["graphics", "own"]
)
def test_a_contact_that_was_foreseen_gives_no_energy(
    tmp_path: Path, force: float, contacts: dict[str, str]
) -> None:
    """10 m/s^2, at 10 Hz."""
    made = pushed_against_a_wall(tmp_path, force, 10, **contacts)
    assert not any("frame" in line for line in made.run["warnings"])
    held = made.run.get("held_contacts")
    assert held["given"] == 0.0 if force == 5.0 else held is None
    rows = made.tables["haptics"]
    x, energy = rows["virtual_mechanism.x"][:, 0], rows["virtual_mechanism.energy"]
    assert energy[-1] - energy[0] == pytest.approx(force * (x[-1] - x[0]), abs=2e-3)
