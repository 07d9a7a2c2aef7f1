"""Log messages of FMUs are kept up to their bounds."""

import sys

import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi import messages
from tests.little_fmus import edited_entries, python_fmu
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


def test_an_fmu_that_says_why_it_cannot_be_instantiated_is_not_asked_for_its_guid(tmp_path):
    path = python_fmu(tmp_path, "Locked")
    (module,) = tmp_path.glob("m*.py")
    text = module.read_text().replace("super()", "raise ValueError('no key'); super()", 1)
    edited_entries(path, lambda held: held | {f"resources/{module.name}": text.encode()})
    made = simulate(str(scene(tmp_path, fmu_table("fmu", "Locked"))), tmp_path / "out")
    fault = str(made.outcome.fault)
    assert "could not be loaded: its instantiation failed at t = 0 s" in fault
    assert "no key" in fault


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


TALKS = """from pythonfmu.enums import Fmi2Status
        if self.steps == 3:
            self.log("the valve is\\tshut", Fmi2Status.warning)
        if self.steps < 3 * self.gain:
            self.log("turning", Fmi2Status.ok)
        self.y = time"""


@pytest.mark.parametrize("isolate", ["", "isolate = true\n"])
def test_what_fmus_log_in_a_run_that_succeeds_is_in_a_file(tmp_path, isolate):
    python_fmu(tmp_path, "Talks", TALKS)
    quiet = "start.gain = 0.0\n"
    path = scene(tmp_path, fmu_table("one", "Talks", isolate) + fmu_table("two", "Talks", quiet))
    found = simulate(str(path), tmp_path / "out").results
    lines = (tmp_path / "out" / "fmus.log").read_text().splitlines()
    warning = f"{2 / 64:g}", "warning", "the valve is shut"
    for name in ("one", "two"):
        own = [line.split("\t") for line in lines if line.split("\t")[1] == name]
        assert [(t, status, text) for t, _, status, _, text in own if status != "ok"] == [warning]
    assert found.record.logged["two"] == {"warning": 1}
    said = [line for line in found.record.warnings or () if "fmus.log" in line]
    assert said == [] or len(said) == 2
    path.write_text(path.read_text().replace("Talks", "Quiet"))
    python_fmu(tmp_path, "Quiet")
    simulate(str(path), tmp_path / "out")
    assert not [*(tmp_path / "out").glob("*log*")]


def test_a_log_ends_with_how_many_more_there_were(tmp_path, monkeypatch):
    monkeypatch.setattr(messages, "MAX_WRITTEN", 3)
    key = messages.open_log()
    messages.write_to(key, str(tmp_path / "log"), "one", lambda: 0.25)
    for i in range(5):
        messages.keep_message(key, 0, b"note %d" % i, b"logAll")
    for i in range(4):  # none of which the notes leave out
        messages.keep_message(key, 1, b"%d" % i, b"logAll")
    messages.close_log(key)
    said = (tmp_path / "log").read_text().splitlines()
    assert said[:3] == [f"0.25\tone\tok\tlogAll\tnote {i}" for i in range(3)]
    assert said[3:6] == [f"0.25\tone\twarning\tlogAll\t{i}" for i in range(3)]
    assert said[6:] == ["0.25\tone\tok\tleft out\t2", "0.25\tone\twarning\tleft out\t1"]
    assert messages.count_messages(tmp_path / "log") == {"one": {"ok": 5, "warning": 4}}
