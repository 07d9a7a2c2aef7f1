"""An FMU that is served from another computer: an isolated one whose process is there.

The calls and their answers are those of `fmi/isolated.py`; they go through a channel in the place
of pipes, with names in the place of objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic_ns
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.fmi.isolated import LOADING, Isolated
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.fmi.worker_process import Died
from hapticlink.orchestrator.network import key_file
from hapticlink.orchestrator.system.system import ServedAt

if TYPE_CHECKING:
    from hapticlink.orchestrator.network.channel import Channel

CLOSING = 2.0
"""Seconds that a server may take to close its FMU, which no result waits for."""
OUTAGE = 0.5
"""Seconds without an answer to a step that count as an outage."""
FRAME = ("sent", "received", "answered", "arrived", "attempts")
"""Columns of the table of frames beside their stamp: when a step was sent, received there and
answered, and its outputs arrived, t_1 to t_4, in s of the run, t_2 and t_3 by the estimated offset;
and how often it was sent."""
FRAMES = "frames"
"""The table of an FMU's frames is <fmu>_frames.csv."""


class Remote(Isolated):
    """An FMU on a server: `step` sends a doStep, `finish` waits for its outputs."""

    def __init__(self, at: ServedAt, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._at = at
        self._outages: list[tuple[float, float]] = []
        self._channel: Channel | None = None

    def _load(self) -> None:
        key = key_file.read_key(self._at.key)
        # Here, since every run imports this file, and few have the extra.
        from hapticlink.orchestrator.network.channel import Channel

        self._channel = Channel(self._at.address, key, len(self.outputs))
        self._process = self._channel
        self._process.interruptible = True
        outputs = [s.name for s in self.description.outputs]
        # The answer waits for `enter_initialization`, and may wait for a server that starts late.
        self._send("hello", self.name, outputs, dict(self._at.identity), allowed=LOADING)

    def _died(self, how: Died) -> FmuFault:
        self._end()
        return FmuFault(self.name, f"its server at {self._at.address} {how}", self.time)

    def _end(self) -> None:
        self._process = None
        if self._channel:
            self._channel.end()

    def jacobian(self, outputs: Sequence[Scalar], inputs: Sequence[Scalar]) -> Matrix | None:
        return None  # differences take their place

    def read_some(self, places: Sequence[int]) -> None:
        self.read()  # all outputs are one message

    def finish(self) -> None:
        begun, channel = self.time, self._channel
        assert channel
        try:
            super().finish()
        finally:
            if (waited := 1e-9 * (monotonic_ns() - channel.sent)) > OUTAGE:
                self._outages.append((begun, waited))

    def dismiss(self) -> None:
        pass  # `close` takes a round trip, or CLOSING

    def abandon(self) -> None:
        if self._channel:
            self._channel.give_up()

    def close(self) -> FmuFault | None:
        """A server that is not there any more keeps nothing back: that is no fault here."""
        channel = self._channel
        try:
            if self._process is None or channel is None or channel.given_up.is_set():
                return None
            if channel.busy:
                channel.answer(CLOSING)
            channel.send(([], "close", ()), CLOSING)
            kind, content = channel.answer()
            if kind != "answer":
                return FmuFault(self.name, *content)
            self._calls = content
        except Died:
            pass
        finally:
            self._end()
        return None

    def frame(self, since: int) -> tuple[float, ...]:
        """The newest frame (FRAME), in s since that long ago (ns)."""
        channel = self._channel
        assert channel
        assert channel.newest
        answer, arrived = channel.newest
        clock = channel.clock.estimate()
        ahead = round(1e9 * clock.offset_at(1e-9 * arrived)) if clock else 0
        there = answer.received - ahead, answer.answered - ahead
        begin = monotonic_ns() - since
        times = (1e-9 * (t - begin) for t in (channel.sent, *there, arrived))
        return (*times, channel.attempts)

    def network(self) -> dict[str, Any]:
        """What became of its messages, and the server's clock, for run.json (s)."""
        channel = self._channel
        assert channel
        clock, times = channel.clock.estimate(), 1e-9 * np.sort(np.array(channel.round_trips))
        shares = {"min": 0.0, "p50": 0.5, "p99": 0.99, "max": 1.0}
        return {
            "server": self._at.address,
            "answers": len(times),
            "repeated": channel.repeated,
            "dropped": channel.dropped,
            "malformed": channel.malformed,
            "outages": self._outages,
            "round_trip": {
                name: float(np.quantile(times, share)) if len(times) else None
                for name, share in shares.items()
            },
            "clock": clock and {**clock._asdict(), "exchanges": channel.clock.exchanges},
        }
