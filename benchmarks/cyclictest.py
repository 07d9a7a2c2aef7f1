"""`cyclictest` of rt-tests: how late the machine wakes a thread of a priority, by a program of
others."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

MOST = 100_000
"""The latency (us) below which each is counted."""


class Latencies:
    """What it says when it ends. counts: of the latencies of 0, 1, ... us; beyond: the number of
    longer ones; largest (us)."""

    def __init__(self, text: str) -> None:
        rows = re.findall(r"^(\d{6}) (\d+)$", text, re.M)
        self.counts: NDArray[np.int64] = np.array([int(count) for _, count in rows], np.int64)
        self.beyond, self.largest = (
            int(re.findall(rf"^# {what}: (\d+)", text, re.M)[0])
            for what in ("Histogram Overflows", "Max Latencies")
        )

    @property
    def wakings(self) -> int:
        return int(self.counts.sum()) + self.beyond

    def later_than(self, period: float) -> int:
        """The number of those above a time (s)."""
        return int(self.counts[int(1e6 * period) + 1 :].sum()) + self.beyond

    def quantiles(self) -> dict[str, float]:
        """p50, p99, p99.9 and the largest, in s."""
        below = self.counts.cumsum()
        shares = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
        places = {n: int(np.searchsorted(below, s * self.wakings)) for n, s in shares.items()}
        return {n: 1e-6 * min(us, self.largest) for n, us in places.items()} | {
            "max": 1e-6 * self.largest
        }


@contextmanager
def beside(rate: float, priority: int) -> Iterator[list[Latencies]]:
    """It runs within the context, where it is installed and may; its latencies are in the list
    afterwards, which is empty otherwise."""
    found: list[Latencies] = []
    program = shutil.which("cyclictest")
    if not program:
        yield found
        return
    options = (f"--priority={priority}", f"--interval={round(1e6 / rate)}", f"--histogram={MOST}")
    with subprocess.Popen(
        [program, "--quiet", "--mlockall", "--threads=1", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as running:
        try:
            yield found
        finally:
            running.send_signal(signal.SIGINT)
            said = running.communicate()[0]
        if "# Max Latencies" in said:
            found.append(Latencies(said))
