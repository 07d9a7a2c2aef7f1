"""A frame block's sample describes the beginning of the frame at whose end it is known: holds
extrapolate from there, ages count from there, and an FMU of others can be declared to be one."""

from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays
from hapticlink.orchestrator.system.build_system import build_system
from tests.little_fmus import slave
from tests.orchestrator.foreign_scenes import fmu_table, ran, wire_table

RATE = 64
SLOW = ["8", "{ min = 7, max = 20, seed = 3 }"]
LATE = '[delays]\n"copy.y" = 0.05\n'


def chain(folder: Path, power: int, hold: str, slow: str, more: str = "") -> str:
    """t^power at 64 Hz, a block at another rate that passes on what it reads when its step begins,
    and a reader at 64 Hz."""
    slave(folder, "Source", ("output", {"y": 0.0}), body=f"self.y = end**{power}")
    for name in ("Copy", "Reader"):
        slave(folder, name, ("input", {"u": 0.0}), ("output", {"y": 0.0}), body="self.y = self.u")
    return (
        fmu_table("source", "Source")
        + fmu_table("copy", "Copy", f'rate = {slow}\ntiming = "frame"\n')
        + fmu_table("reader", "Reader", 'timing = "sampled"\n')
        + wire_table("source.y", "copy.u")
        + wire_table("copy.y", "reader.u", f'hold = "{hold}"\n')
        + more
    )


@pytest.mark.parametrize("more", ["", LATE])
@pytest.mark.parametrize("slow", SLOW)
@pytest.mark.parametrize(("hold", "power"), [("foh", 1), ("second-order", 2)])
def test_a_polynomial_through_a_frame_block_is_met(tmp_path, hold, power, slow, more):
    found = ran(tmp_path, chain(tmp_path, power, hold, slow, more), "duration=2.0").haptics
    t = found["time"]
    known = t > (power + 2) / 7 + (0.05 if more else 0.0)  # frames until there are samples enough
    assert np.abs(found["reader.y"] - t**power)[known].max() < 1e-12
    assert known.sum() > 64


def test_a_half_step_lead_leads_by_the_frame_too(tmp_path):
    found = ran(tmp_path, chain(tmp_path, 1, "lead", "8"), "duration=2.0").haptics
    t, y = found["time"], found["reader.y"]
    frames = np.split(y - t, np.flatnonzero(t % 0.125 == 0))[4:-1]
    half_a_tick = 0.5 / RATE  # of 8 values in a frame, the mean is so much before its middle
    assert np.allclose([frame.mean() for frame in frames], half_a_tick, atol=1e-12)


def test_without_the_declaration_it_is_a_frame_late(tmp_path):
    text = chain(tmp_path, 1, "foh", "8").replace('timing = "frame"', 'timing = "continuous"')
    found = ran(tmp_path, text, "duration=2.0").haptics
    late = (found["time"] - found["reader.y"])[found["time"] > 0.5]
    assert np.allclose(late, 0.125, atol=1e-12)


@pytest.mark.parametrize("slow", SLOW)
@pytest.mark.parametrize("more", ["", LATE])
def test_ages_count_from_what_a_sample_describes(tmp_path, slow, more):
    """By the reader's own words: with zoh it has the time at which the copy read its input."""
    text = chain(tmp_path, 1, "zoh", slow, more)
    experiment = simulate(open_scene.load(_write(tmp_path, text)), tmp_path / "out")
    table = experiment.results.haptics
    ages = (table["time"] - table["reader.y"])[1:]
    told = experiment.outcome.ending(0.0).delays["copy.y -> reader.u"]
    # The copy's input is the newest tick at its step's beginning, which may lie between two.
    assert told.max == pytest.approx(ages.max(), abs=1 / RATE)
    assert told.mean == pytest.approx(ages.mean(), abs=1 / RATE)
    assert told.max > 0.125


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_graphics_copy_shows_where_the_mechanism_was(tmp_path, hold):
    options = ["duration=0.5", "graphics.rate=512/16", f"hold={hold}"]
    experiment = simulate("closed-loop-ideal", tmp_path / "out", options)
    haptics, graphics = experiment.results.haptics, experiment.results.graphics
    there = haptics["virtual_mechanism.q"][::16]
    shown = graphics["virtual_environment.q"][1:]
    assert np.abs(shown - there[: len(shown)]).max() < 1e-13  # they are put on the closures
    assert np.abs(shown - there[1 : len(shown) + 1]).max() > 0.01
    with build_system(open_scene.load("closed-loop-ideal", options)) as system:
        age = delays(Plan(system))["virtual_environment.Lambda_inv -> controller.Lambda_inv"]
    assert (age.min, age.max) == (16 / 512, 31 / 512)


def _write(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(f'title = "test"\nduration = 2.0\nhaptics.rate = {RATE}\n{text}')
    return path
