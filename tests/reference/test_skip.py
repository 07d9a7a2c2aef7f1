"""The short form of `hapticlink bench skip`: skipping changes no bit, and saves what it counts."""

import pytest

from benchmarks.skip import OFF, ON, compared, counts, run

SHORT = "duration=0.5"


@pytest.mark.parametrize(
    "scene", ["closed-loop-ideal", "five-bar", "virtual-wall", "parallelogram"]
)
def test_results_are_the_same_to_the_bit(tmp_path, scene):
    made = {s: run(scene, tmp_path / s, s, SHORT) for s in (ON, OFF)}
    values, differ, largest, apart = compared(made[ON], made[OFF])
    assert values > 1000
    assert (differ, largest, apart) == (0, 0.0, "")
    on, off = (counts(made[s], s) for s in (ON, OFF))
    assert off[0] > 1.2 * on[0]
    assert off[1] >= on[1]
    assert off[2] > on[2]


def test_another_result_is_told_from_the_same(tmp_path):
    first = run("five-bar", tmp_path / "a", ON, SHORT)
    second = run("five-bar", tmp_path / "b", OFF, SHORT, "hand.wrench=[-0.5, 0.0, -0.0026]")
    values, differ, largest, _ = compared(first, second)
    assert 0 < differ < values
    assert largest > 1e-3


def test_only_connected_outputs_cross_where_those_are_recorded(tmp_path):
    """The same FMUs, and without what nobody reads: accelerations and multipliers."""
    some = run("closed-loop-ideal", tmp_path / "some", ON, SHORT, "record.signals=connected")
    every = run("closed-loop-ideal", tmp_path / "every", ON, SHORT)
    steps = some.outcome.details.calls["virtual_mechanism"]["step"]
    saved = counts(every, ON)[0] - counts(some, ON)[0]
    assert saved == pytest.approx(0.12 * 3130 * steps, rel=0.1)
    assert counts(some, ON)[2] < 0.95 * counts(every, ON)[2]


def test_a_diagnostic_of_a_singular_pose_does_not_end_a_run(tmp_path):
    """The parallelogram passes a pose where the condition of its closures is beyond 1e12 times that
    of the start."""
    made = run("parallelogram", tmp_path, ON, "mechanism.diagnostics=true")
    assert made.outcome.fault is None
    assert made.results.haptics["virtual_mechanism.condition"].max() > 1e13
