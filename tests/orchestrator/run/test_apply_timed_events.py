"""What happens at given times: against closed forms and the run's own signals."""

import math

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from tests.little_fmus import slave
from tests.orchestrator.foreign_scenes import fmu_table, scene

K, B = np.array([100.0, 100.0, 0.5]), np.array([70.0, 70.0, 0.375])  # of F_drift, by default

PULLED = {
    "duration": 1.0, "linkage.body.bar.mass": 2.0, "linkage.start_velocity.slide": 0.0,
    "hand.wrench": [1.0, 0.0, 0.0], "at": [{"time": 0.5, "set": {"hand.wrench": [0.0, 0.0, 0.0]}}],
}  # fmt: skip
"""A mass of 2 kg at rest, pulled until the hand lets go."""


def vectors(run, name):
    return np.column_stack([run[f"{name}[{i}]"] for i in (1, 2, 3)])


def seen(run):
    """What the virtual coupling saw of the handle: x_D and v_D in F_drift, entry by entry, as
    K (x_S - x_D) + B (v_S - v_D) - F_drift is 0 for those that the controller has."""
    known = [vectors(run, f"virtual_mechanism.{p}") for p in ("x", "v")]
    force = vectors(run, "controller.F_drift")
    v_D = vectors(run, "haptic_device.v")
    return known[0] - (force - B * (known[1] - v_D)) / K


@pytest.mark.parametrize(
    ("options", "happened"),
    [
        ({}, 0.5),
        ({"at.0.time": 0.5001}, 257 / 512),  # with the first step from its time on
        ({"duration": 0.5}, None),  # what comes after the end does not happen
    ],
)
def test_a_hand_that_lets_go_leaves_a_mass_at_its_speed(bar, options, happened):
    found = hl.run(bar, PULLED | options)
    time, speed = found.haptics["time"], found.haptics["virtual_mechanism.v[1]"]
    np.testing.assert_allclose(speed, np.minimum(time, happened or 0.5) / 2.0, atol=1e-12)
    events = [(happened, "hand.wrench = (0.0, 0.0, 0.0)")]
    assert found.run["events"] == (events if happened else [])


@pytest.mark.parametrize(
    ("name", "value", "takes"),
    [
        ("gain", "true", "true: gain, of type Real, takes a number"),
        ("u", "[true]", "true: u, of type Real, takes a number"),
        ("n", "true", "true: n, of type Integer, takes a number"),
        ("n", "2.5", "2.5: n, of type Integer, takes a whole number"),
        ("on", "2", "2: on, of type Boolean, takes true or false"),
        ("n", "2.0", ""),
        ("on", "1", ""),
        ("gain", "2", ""),
    ],
)
def test_values_are_of_the_type_of_their_variable(tmp_path, name, value, takes):
    inputs = ("input", {"u": 0.0, "n": 0, "on": False})
    slave(tmp_path, "Typed", inputs, ("tunable", {"gain": 1.0}), ("output", {"y": 0.0}))
    event = f'[[at]]\ntime = 0.25\nset = {{ "one.{name}" = {value} }}\n'
    path = scene(tmp_path, fmu_table("one", "Typed") + event)
    if not takes:
        assert hl.run(path, figures=False).fault is None
        return
    with pytest.raises(InputFault, match=takes):
        hl.run(path, figures=False)


def test_without_events_nothing_runs_in_python():
    found = hl.run("closed-loop-ideal", ["duration=0.1"])
    assert found.run["events"] == []
    assert found.run["in_python"] == {}


def around(table, begin, end):
    time = table["time"]
    return (time >= begin) & (time < end)


def test_an_input_is_frozen_overridden_or_noisy_for_a_while():
    x, given = "controller.x_D", [0.05, 0.01, 0.1]
    at = f"""at=[{{ time = 0.1, until = 0.15, freeze = ["{x}"] }},
        {{ time = 0.2, until = 0.25, override = {{ "{x}" = {given} }} }},
        {{ time = 0.3, until = 0.4, noise = {{ "{x}" = 1e-6 }}, seed = 7 }}]"""
    run = hl.run("closed-loop-ideal", ["duration=0.5", at, "stop_when="]).haptics
    x_D = vectors(run, "haptic_device.x")
    frozen, overridden, noisy = (
        around(run, *times) for times in ((0.1, 0.15), (0.2, 0.25), (0.3, 0.4))
    )
    expected, begin = x_D.copy(), x_D[frozen][0]
    expected[frozen], expected[overridden] = begin, given
    drawn = np.random.Generator(np.random.PCG64(7)).standard_normal((noisy.sum(), 3))
    expected[noisy] += 1e-6 * drawn
    np.testing.assert_allclose(seen(run)[:-1], expected[:-1], rtol=0, atol=1e-9)
    assert np.abs(x_D[frozen] - begin).max() > 1e-4


def test_graphics_go_on_at_another_rate():
    at = 'at=[{time=0.5, set={"graphics.rate"=10}}, {time=0.75, set={"graphics.rate"=60}}]'
    run = hl.run("closed-loop-ideal", ["duration=1.0", at])
    times = run.graphics["time"]
    assert math.isclose(times[times <= 0.5][-1], 0.5)
    slow, fast = (np.diff(times[(times >= a) & (times <= b)]) for a, b in ((0.5, 0.79), (0.85, 1)))
    assert np.abs(slow - 0.1).max() <= 1 / 512
    assert np.abs(fast - 1 / 60).max() <= 1 / 512
    assert [time for time, _ in run.run["events"]] == [0.5, times[times >= 0.75][0]]


def test_lines_in_the_figures():
    at = 'at=[{time=0.25, set={"graphics.rate"=15}}]'
    found = hl.run("closed-loop-ideal", ["duration=0.6", at])
    axes = found.figures()["distance"].axes[0]
    assert any(list(line.get_xdata()) == [found.run["events"][0][0]] * 2 for line in axes.lines)


def test_one_program_of_a_scene_with_events_is_refused(tmp_path):
    with pytest.raises(InputFault, match="at given times"):
        hl.build("scenario", as_one=True, out=tmp_path)


def test_a_text_is_set(tmp_path):
    variables = ("input", {"mode": "idle"}), ("output", {"y": 0.0})
    slave(tmp_path, "Modes", *variables, body="self.y = float(self.mode == 'run')")
    text = fmu_table("one", "Modes") + '[[at]]\ntime = 0.25\nset = { "one.mode" = "run" }\n'
    found = hl.run(scene(tmp_path, text), out=tmp_path / "out", figures=False)
    y, t = found["one.y"], found.haptics["time"]
    np.testing.assert_array_equal(y, t > 0.25)
    for wrong, said in (("true", "takes a text"), ("1.5", "takes a text")):
        path = scene(tmp_path, text.replace('"run"', wrong))
        with pytest.raises(InputFault, match=said):
            hl.run(path, out=tmp_path / "other", figures=False)
