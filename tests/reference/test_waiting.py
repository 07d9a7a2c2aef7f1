"""What `hapticlink bench waiting` measures of a process."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks import waiting

COMMAND = str(Path(sys.executable).with_name("hapticlink"))


def test_a_process_is_measured_by_its_processor_time(tmp_path: Path) -> None:
    idle = waiting._take(COMMAND, ["-c", "import time; time.sleep(1); print('rests')"], tmp_path)
    busy = waiting._take(
        COMMAND,
        ["-c", "import time\nwhile time.process_time() < 1: pass"],
        tmp_path,
    )
    assert idle.printed == "rests\n"
    assert 0.0 < idle.seconds < 1.0 <= busy.seconds


def test_two_checkouts_take_turns_and_are_compared_beside_a_neighbour(tmp_path: Path) -> None:
    (tmp_path / Path(sys.executable).name).symlink_to(sys.executable)
    both = [str(tmp_path / "hapticlink"), COMMAND]
    before, after, beside, counts = waiting._measured(["-c", "pass"], both, 1)
    assert min(before, after, beside) > 0.0
    assert counts == ""


def test_of_an_earlier_checkout_what_it_does_not_know_is_left_out(tmp_path: Path) -> None:
    without = tmp_path / Path(sys.executable).name
    without.write_text("#!/bin/sh\nexit 2\n")
    without.chmod(0o755)
    earlier = str(tmp_path / "hapticlink")
    before, after, beside, counts = waiting._measured(["-c", "pass"], [earlier, COMMAND], 1)
    assert (before, beside, counts) == ("", "", "")
    assert after > 0.0
    with pytest.raises(RuntimeError):
        waiting._measured(["-c", "pass"], [COMMAND, earlier], 1)


def test_a_scene_that_was_renamed_is_measured_under_both_names(tmp_path: Path) -> None:
    only = "import sys; sys.exit(2 * (sys.argv[1:] != ['closed-loop']))"
    known = waiting._known(COMMAND, ["-c", only, "closed-loop-ideal"], tmp_path, "another")
    assert known == ["-c", only, "closed-loop"]


def test_a_command_that_fails_is_no_measurement(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="no such thing"):
        waiting._take(COMMAND, ["-c", "import sys; print('no such thing'); sys.exit(3)"], tmp_path)
