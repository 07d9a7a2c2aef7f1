"""Log messages of FMUs are kept up to their bounds."""

import sys

import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi import messages
from tests.orchestrator.foreign_fmus import python_fmu
from tests.orchestrator.foreign_scenes import fmu_table, scene


def test_the_newest_messages_are_kept_and_no_novel():
    key = messages.open_log()
    for i in range(20_000):
        messages.keep_message(key, 2, b"%d " % i + b"x" * 10_000)
    messages.keep_message(key, 0, b"all is well")
    messages.keep_message(key, -1, b"20000 is no status that FMI defines")
    kept = messages.newest_messages(key)
    messages.close_log(key)
    assert [said.split()[0] for said in kept] == [str(i) for i in range(19_996, 20_001)]
    assert {len(said) for said in kept[:-1]} == {messages.MAX_LENGTH}
    messages.keep_message(key, 3, b"after the end")
    assert messages.newest_messages(key) == []


@pytest.mark.parametrize("isolate", ["", "isolate = true\n"])
@pytest.mark.parametrize(
    ("code", "error"),
    [
        ("self.y = 1 / (2 - self.steps)", "ZeroDivisionError: division by zero"),
        (  # in a file of another library
            "self.y = Fraction(1, 2 - self.steps)", "ZeroDivisionError: Fraction(1, 0)"
        ),
    ],
)  # fmt: skip
def test_an_exception_of_a_python_fmu_has_its_file_and_line(tmp_path, isolate, code, error):
    python_fmu(tmp_path, "Slow", f"from fractions import Fraction; {code}")
    (module,) = tmp_path.glob("m*.py")
    text = module.read_text().splitlines()
    line = next(i for i, each in enumerate(text, 1) if code in each)
    path = scene(tmp_path, fmu_table("slow", "Slow", isolate))
    fault = str(simulate(str(path), tmp_path / "out").outcome.fault)
    where = f"{module.name}, line {line}, in do_step: {text[line - 1].strip()}"
    assert f"slow says: {where}: {error}\n" in fault


def test_instances_that_share_a_class_each_have_their_own_exceptions(tmp_path):
    """However often they run: a method is replaced once, and no call becomes dearer."""
    python_fmu(tmp_path, "Shared", "1 / (self.instance_name != 'second' or self.steps - 2)")
    path = scene(tmp_path, fmu_table("first", "Shared") + fmu_table("second", "Shared"))
    (module,) = tmp_path.glob("m*.py")
    for _ in range(3):
        fault = str(simulate(str(path), tmp_path / "out").outcome.fault)
        assert f"second says: {module.name}, line " in fault
        assert "first says" not in fault
        step = sys.modules[module.stem].Shared.do_step
        assert not hasattr(step.__wrapped__, "__wrapped__")
