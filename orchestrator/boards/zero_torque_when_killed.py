"""A process that takes the torque off a board if this process is killed.

It waits for the end of a pipe that only this process holds open, and then writes the message of
zero torque to the board's port. It needs the standard library alone, so that it is there within
some hundredths of a second.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_CODE = """
import os, signal, sys
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
except (AttributeError, OSError):
    pass
port, message = int(sys.argv[1]), bytes.fromhex(sys.argv[2])
os.write(1, b"1")
if not os.read(0, 1):
    os.write(port, message)
"""
PRIORITY = 21
"""Of that process, above that of the haptic loop, where the user may."""


@contextmanager
def write_if_killed(port: int, message: bytes) -> Iterator[None]:
    """Context in which a process stands by that writes `message` to the file descriptor `port` once
    this process has ended within the context. POSIX only."""
    code = _CODE.replace("PRIORITY", str(PRIORITY))
    with subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", code, str(port), message.hex()],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=(port,),
        start_new_session=True,  # what ends this one's group leaves it
    ) as process:
        assert process.stdin
        assert process.stdout
        os.read(process.stdout.fileno(), 1)
        try:
            yield
        finally:
            with suppress(OSError):
                process.stdin.write(b"0")
                process.stdin.close()
