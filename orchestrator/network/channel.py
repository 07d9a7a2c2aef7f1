"""The run's side of a connection to a server: one call at a time, asked again until it is answered.

A call is sent over one of a few connections (lanes). TCP repairs what the network loses, but
only after 200 ms and more; so a call that is not answered in time is sent again over the next lane,
by the timer of RFC 6298, and the server answers a call that it has carried out from memory. Answers
that come twice, late or overtaken are dropped by their number. A lane that is dead is noticed by
ZeroMQ's heartbeats, and connected anew.
"""

from __future__ import annotations

import secrets
from array import array
from threading import Event
from time import monotonic_ns
from typing import Any

import zmq

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.fmi.worker_process import Died
from hapticlink.orchestrator.network import key_file, messages
from hapticlink.orchestrator.network.clock_filter import ClockFilter
from hapticlink.orchestrator.network.messages import Answer, Malformed, Request

LANES = 3
WATCH = 50_000_000
"""ns between two looks at whether the run has given up."""
FIRST, LEAST, LONGEST = 250_000_000, 10_000_000, 250_000_000
"""ns until a call is sent again: the first time, at least, and at most."""
UNHEARD = "is `hapticlink serve` running there, with the same key, and the port open?"
REFUSALS = 3
"""Connections without an answer that were closed by the server, as it does with a wrong key."""
SECURE = {"linger": 0, "maxmsgsize": messages.MOST, "ipv6": 1}
ALIVE = {"heartbeat_ivl": 200, "heartbeat_timeout": 800, "handshake_ivl": 2000}
"""Options of both sides' sockets (ms), as zmq_setsockopt describes them."""
LANE = {"sndhwm": 8, "rcvhwm": 64, "immediate": 1, "connect_timeout": 500, "reconnect_ivl": 50}


class Channel:
    """`send` a call, then take its `answer`, as of a worker process, from one thread at a time.

    outputs: their number, by which answers are checked. newest: the newest answer and when it
    arrived (ns).
    """

    def __init__(self, address: str, key: key_file.Key, outputs: int) -> None:
        self.address, self._outputs = address, outputs
        self._context, self._poller = zmq.Context(), zmq.Poller()
        self._lanes = [self._connected(key) for _ in range(LANES)]
        self._lane = 0
        events = zmq.EVENT_HANDSHAKE_FAILED_AUTH | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
        events |= zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
        self._monitor = self._lanes[0].get_monitor_socket(events)
        self._refusals = 0
        self._session, self._number = secrets.token_bytes(16), -1
        self._timer = Timer()
        self.given_up = Event()
        self.clock = ClockFilter()
        self.round_trips = array("q")
        self.newest: tuple[Answer, int] | None = None
        self.busy = self.interruptible = False
        self.attempts = self.repeated = self.dropped = self.malformed = 0
        interrupt.add(self.give_up)

    def _connected(self, key: key_file.Key) -> Any:
        lane = self._context.socket(zmq.DEALER)
        for option, value in (SECURE | ALIVE | LANE).items():
            setattr(lane, option, value)
        lane.curve_publickey, lane.curve_secretkey = key
        lane.curve_serverkey = key.public
        lane.connect(f"tcp://{self.address}")
        self._poller.register(lane, zmq.POLLIN)
        return lane

    def send(self, message: Any, allowed: float) -> None:
        """Send a call, (pending, call, arguments), whose answer may take `allowed` s."""
        self._message, self._allowed = message, allowed
        self._number += 1
        self.busy, self.attempts, self.sent = True, 0, monotonic_ns()
        self._transmit()

    def _transmit(self) -> None:
        """Send the call, over the next lane where it was sent before."""
        if self.attempts:
            self._lane = (self._lane + 1) % LANES
            self.repeated += 1
        pending, call, arguments = self._message
        now = monotonic_ns()
        request = Request(self._session, self._number, now, pending, call, arguments)
        for _ in range(LANES):
            try:
                self._lanes[self._lane].send(request.packed(), zmq.NOBLOCK)
                break
            except zmq.Again:  # it is not connected
                self._lane = (self._lane + 1) % LANES
        self._due = now + self._timer.patience(self.attempts)
        self.attempts += 1

    def answer(self, allowed: float | None = None) -> tuple[str, Any]:
        """Wait for the answer, if given for `allowed` s from now on: its kind and content. Raises
        Died where there is none, or a refusal."""
        begun = self.sent if allowed is None else monotonic_ns()
        allowed = self._allowed if allowed is None else allowed
        deadline = begun + round(1e9 * allowed)
        while (answer := self._arrived()) is None:
            now = monotonic_ns()
            if self.given_up.is_set() or (self.interruptible and interrupt.came()):
                raise Died("was given up")
            if now > deadline:
                hint = "" if self.newest else f": {UNHEARD}"
                raise Died(f"has not answered within {allowed:g} s{hint}")
            if self._refused():
                raise Died("closes each connection: its key is another one")
            if now >= self._due:
                self._transmit()
            wait = min(self._due, deadline, now + WATCH) - now
            self._poller.poll(max(wait // 1_000_000, 0) + 1)
        self.busy = False
        if answer.kind == "refused":
            raise Died(f"refuses: {answer.content}")
        return answer.kind, answer.content

    def _arrived(self) -> Answer | None:
        """The answer that is awaited, if it has come; others are counted."""
        for i, lane in enumerate(self._lanes):
            while True:
                try:
                    message = lane.recv(zmq.NOBLOCK)
                except zmq.Again:
                    break
                arrived = monotonic_ns()
                try:
                    answer = messages.answer_of(message, self._message[1], self._outputs)
                except Malformed:
                    self.malformed += 1
                    continue
                if answer.number != self._number:
                    self.dropped += 1
                    continue
                self._lane, self.newest = i, (answer, arrived)
                self.clock.add(answer.sent, answer.received, answer.answered, arrived)
                waited = arrived - answer.sent
                self.round_trips.append(waited - (answer.answered - answer.received))
                self._timer.add(waited)
                return answer
        return None

    def _refused(self) -> bool:
        """Whether the server has refused each connection so far."""
        while self.newest is None and self._monitor.poll(0):
            self._monitor.recv_multipart(zmq.NOBLOCK)
            self._refusals += 1
        return self._refusals >= REFUSALS

    def give_up(self) -> None:
        """Let `answer` return at once; from any thread."""
        self.given_up.set()

    def end(self) -> None:
        """Close the connections."""
        self.give_up()
        interrupt.remove(self.give_up)
        self._context.destroy(linger=0)


class Timer:
    """When a call is to be sent again (ns): RFC 6298, by all times that answers took."""

    def __init__(self) -> None:
        self._mean = self._deviation = 0.0

    def add(self, took: int) -> None:
        """Take the time (ns) that an answer took."""
        if not self._mean:
            self._mean, self._deviation = took, took / 2
            return
        self._deviation += (abs(took - self._mean) - self._deviation) / 4
        self._mean += (took - self._mean) / 8

    def patience(self, attempts: int) -> int:
        """The time to wait after so many attempts, doubled with each."""
        first = self._mean + 4 * self._deviation if self._mean else FIRST
        return round(min(max(first, LEAST) * 2**attempts, LONGEST))
