"""The keys of a run with a board."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time

import pytest

from hapticlink.commands.stop_key import stop_key, wait_for_enter
from tests.shared_fixtures import status

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a pseudo-terminal stands for the user")


@pytest.fixture
def keyboard(monkeypatch):
    """Writes to the terminal that is standard input."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield lambda keys: os.write(ours, keys)
    os.close(ours)


def test_any_key_without_enter_is_seen(keyboard):
    with stop_key() as pressed:
        assert pressed is not None
        assert not pressed()
        keyboard(b" ")
        assert pressed()


def test_the_terminal_is_as_before(keyboard):
    import termios

    before = termios.tcgetattr(sys.stdin)
    with stop_key():
        assert termios.tcgetattr(sys.stdin) != before
    assert termios.tcgetattr(sys.stdin) == before


def test_without_a_terminal_there_is_no_key(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.StringIO("x"))
    with stop_key() as pressed:
        assert pressed is None
    wait_for_enter("hold the handle in its home pose")  # returns
    assert not capsys.readouterr().err


def test_enter_says_that_it_is_done(keyboard, capsys):
    keyboard(b"\n")
    wait_for_enter("hold the handle in its home pose")
    assert capsys.readouterr().err == "hold the handle in its home pose, then press Enter\n"


def test_ctrl_c_ends_a_trial_that_waits_for_an_answer(tmp_path, monkeypatch, capsys):
    """And answers that are there are not written over."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "made").mkdir()
    options = ("--vary", "graphics.rate=16", "--device", "simulated-board")
    line = ["trial", "closed-loop-2diy", "--out", "made", *options]
    with subprocess.Popen(
        [sys.executable, "-m", "hapticlink", *line],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as trial:  # fmt: skip
        assert trial.stderr
        while not (said := trial.stderr.readline()).endswith("[y/q]\n"):
            assert said
        time.sleep(0.2)
        trial.send_signal(signal.SIGINT)
        try:
            assert trial.wait(20) == 1
            assert trial.stderr.read() == "hapticlink: interrupted\n"
        finally:
            trial.kill()
    (tmp_path / "made" / "answers.csv").write_text("trial,graphics.rate,varied,answer,right\n")
    assert status(*line) == 2
    told = capsys.readouterr().err
    assert "answers.csv: has answers of earlier trials: name another --out" in told
