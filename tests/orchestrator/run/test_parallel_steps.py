"""Isolated FMUs step concurrently, with the same results and faults as one after the other."""

import pytest

from tests.little_fmus import python_fmu
from tests.orchestrator.c_fmus import hostile_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, fault, fmu_table, ran, run, wire_table

MEET = """import pathlib, time as clock
        folder = pathlib.Path({folder!r})
        (folder / f"{own}{{self.steps}}").touch()
        end = clock.monotonic() + 20
        while not (folder / f"{other}{{self.steps}}").exists():
            if clock.monotonic() > end: raise RuntimeError("nobody came")
            clock.sleep(0.001)
        self.y = time + size"""


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
def test_steps_of_an_instant_run_at_the_same_time(tmp_path, coupling):
    """Each waits in its step for the other to be in the same step."""
    for name, own, other in (("First", "a", "b"), ("Second", "b", "a")):
        python_fmu(tmp_path, name, MEET.format(folder=str(tmp_path), own=own, other=other))
    both = fmu_table("one", "First", ISOLATED) + fmu_table("two", "Second", ISOLATED)
    text = f'coupling = "{coupling}"\n' + both + wire_table("one.y", "two.u")
    found = ran(tmp_path, text)
    assert found.haptics["one.y"].tolist() == found.haptics["time"].tolist()


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_of_two_that_fail_the_first_of_the_plan_is_told(tmp_path, isolate):
    python_fmu(tmp_path, "Late", "__import__('time').sleep(0.05 * (time > 0.1)); return time < 0.1")
    python_fmu(tmp_path, "Early", "return time < 0.1")
    for first, second in (("Late", "Early"), ("Early", "Late")):
        both = fmu_table("one", first, isolate) + fmu_table("two", second, isolate)
        experiment, found = run(tmp_path, both)
        said = "one: fmi2DoStep returned discard at t = 0.109375 s"
        assert str(experiment.outcome.fault) == said
        assert found.haptics["time"][-1] == 0.109375


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_outputs_that_cannot_be_read_are_a_fault_when_they_are_due(tmp_path, isolate):
    hostile_fmu(tmp_path)
    python_fmu(tmp_path, "Goes")
    slow = fmu_table("get_error_3", "hostile", f"{isolate}rate = 8\n")
    experiment, found = run(tmp_path, slow + fmu_table("two", "Goes", isolate))
    said = "get_error_3: fmi2GetReal returned error at t = 0.375 s"
    assert str(experiment.outcome.fault) == said
    assert found.tables["8hz"]["get_error_3.y"].tolist() == [0, 1, 2]
    assert found.haptics["two.y"].tolist() == found.haptics["time"].tolist()
    assert found.haptics["time"][-1] == 23 / 64  # those of 0.375 s come after the read


def test_one_that_dies_leaves_the_others_a_clean_end(tmp_path):
    """They have been sent their steps when it dies."""
    hostile_fmu(tmp_path)
    ended = tmp_path / "ended"
    said = f"__import__('atexit').register(open, {str(ended)!r}, 'w') if self.steps == 1 else None"
    python_fmu(tmp_path, "Other", f"{said}; __import__('time').sleep(0.05)")
    text = fmu_table("step_abort_4", "hostile", ISOLATED)
    said = fault(tmp_path, text + fmu_table("two", "Other", ISOLATED))
    assert said == "step_abort_4: its process ended by SIGABRT at t = 0.046875 s"
    assert ended.exists()  # by a process that was not killed
