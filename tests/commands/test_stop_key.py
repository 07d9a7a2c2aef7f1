"""The keys of a run with a board."""

from __future__ import annotations

import io
import os
import sys

import pytest

from hapticlink.commands.stop_key import stop_key, wait_for_enter

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
