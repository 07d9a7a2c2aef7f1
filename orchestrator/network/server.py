"""Serves FMUs of a scene: carries out the calls of one run at a time for each FMU.

A call is carried out once: it is answered from memory when it comes again, and refused when its
number, the order of FMI's calls or a step's time is not the next one. Whoever has no key is
refused by ZeroMQ before a message is read (CurveZMQ).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from time import monotonic_ns
from typing import Any

import numpy as np
import zmq
from zmq.auth.thread import ThreadAuthenticator

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import AsksToEnd, FmuFault, InputFault
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.worker import HostedFmu, fault_fields
from hapticlink.orchestrator.network.channel import ALIVE, SECURE
from hapticlink.orchestrator.network.key_file import Key
from hapticlink.orchestrator.network.messages import Answer, Malformed, Request, request_of
from hapticlink.orchestrator.network.served_part import Identity, differences
from hapticlink.orchestrator.system.system import Fmu

LEASE = 10.0
"""Seconds after which an FMU is free for another run if its own is not heard of."""
POLL = 100
"""ms between two looks at whether a signal has come."""
BOUNDED = {"sndhwm": 64, "rcvhwm": 64, "backlog": 16}
"""Messages of a connection that wait, and connections that are not accepted yet."""
KINDS = 50
"""Kinds of refusals that are told apart: nobody fills the memory with them."""
SETTERS, SLOTS = 1000, 4
"""Groups of inputs that a run may connect to an FMU, and states of it that a run may save."""
BACK = 1e-9
"""Seconds by which a step may begin before the end of the one before it: rounding."""
PHASES = {
    "loaded": ("connect", "read", "enter_initialization", "close"),
    "initializing": ("connect", "read", "exit_initialization", "close"),
    "running": ("connect", "read", "step", "save", "rollback", "close"),
    "closed": (),
}
"""The calls that FMI allows in each phase."""
NEXT = {"enter_initialization": "initializing", "exit_initialization": "running"}


class ServedFmu(HostedFmu):
    """An FMU that a run has loaded: what the run may call, and the answer to its newest call."""

    def __init__(self, request: Request, fmu: Fmu, policy: Faults) -> None:
        super().__init__()
        self.identifier, self.number = request.session, request.number
        self.newest: tuple[str, Any] | None = None
        self.heard = monotonic_ns()
        self.phase = "loaded"
        self._reached, self._saved = -np.inf, set[int]()
        self._groups: dict[tuple[str, ...], int] = {}
        """The inputs of each setter, and its key."""
        scalars = {s.name: s for s in fmu.description.outputs}
        self._restores = fmu.description.restores_state
        outputs = request.arguments[1]
        if not all(type(name) is str and name in scalars for name in outputs):
            raise Malformed("hello: outputs that the FMU does not have")
        others = (s for s in fmu.description.scalars if s.causality != "output")
        kept = replace(
            fmu.description, scalars=(*others, *(scalars[name] for name in dict.fromkeys(outputs)))
        )
        self.load(fmu.name, kept, fmu.starts, policy)

    def connect(self, names: Sequence[str]) -> int:
        """The key of a setter, that which these inputs have where they have one. Raises Malformed
        for what no run asks for."""
        if not all(type(name) is str and name in self._inputs for name in names):
            raise Malformed("connect: inputs that the FMU does not have")
        group = tuple(names)
        if len({*group}) < len(group):
            raise Malformed("connect: an input twice")
        if group not in self._groups:
            if len(self._groups) == SETTERS:
                raise Malformed(f"connect: more than {SETTERS} groups of inputs")
            self._groups[group] = super().connect(group)
        return self._groups[group]

    def carry_out(self, request: Request) -> Any:
        """What the call returns. Raises Malformed, or the fault of the FMU."""
        call, arguments = request.call, request.arguments
        if call not in PHASES[self.phase]:
            raise Malformed(f"{call} is not allowed now ({self.phase})")
        sizes = [len(group) for group in self._groups]
        for key, values in request.pending:
            if not (0 <= key < len(sizes) and len(values) == 8 * sizes[key]):
                raise Malformed("inputs of another size")
        if call == "step":
            time, _, size = arguments
            if not (time >= self._reached - BACK and size > 0):
                raise Malformed(f"a step from {time:g} s, where the FMU is at {self._reached:g} s")
            self._reached = time + size
        elif call in ("save", "rollback"):
            self._require_slot(call, arguments[0])
        result = self.called(request.pending, call, arguments)
        if call == "save":
            self._saved.add(arguments[0])
        elif call == "rollback":
            self._reached = -np.inf
        self.phase = NEXT.get(call, self.phase)
        return result

    def _require_slot(self, call: str, slot: int) -> None:
        """Raises Malformed where the FMU has no states, or no such one."""
        if not self._restores:
            raise Malformed(f"{call}: the FMU cannot save its state")
        if not 0 <= slot < SLOTS:
            raise Malformed(f"{call}: slot {slot}, where there are 0 to {SLOTS - 1}")
        if call == "rollback" and slot not in self._saved:
            raise Malformed(f"rollback: no state was saved in slot {slot}")

    def close(self) -> dict[str, int]:
        self.phase = "closed"
        return super().close()


class Server:
    """Serves `fmus`, each with what a run has to agree on. say: is told what happens."""

    def __init__(
        self,
        fmus: Mapping[str, tuple[Fmu, Identity]],
        policy: Faults,
        say: Callable[[str], object],
    ) -> None:
        self._fmus, self._policy, self._say = fmus, policy, say
        self._sessions: dict[str, ServedFmu] = {}
        self.refused: Counter[str] = Counter()
        """Messages that were not carried out, by reason."""

    def serve(self, address: str, key: Key) -> None:
        """Serve at HOST:PORT until a signal comes. Raises InputFault where that cannot be."""
        with _bind(address, key, self._say) as socket:
            while not interrupt.came():
                if not socket.poll(POLL):
                    continue
                peer, *message = socket.recv_multipart()
                if answer := self.answered(message, monotonic_ns()):
                    try:
                        socket.send_multipart([peer, answer], zmq.NOBLOCK)
                    except zmq.Again:  # it does not read what it asked for
                        self._refuse("not read")

    def close(self) -> None:
        """Close the FMUs of runs that have not."""
        for session in self._sessions.values():
            with suppress(FmuFault):  # nobody is left to receive it
                session.close()

    def answered(self, message: list[bytes], received: int) -> bytes | None:
        """The answer to a message that was received then (ns), None where it gets none."""
        try:
            if len(message) != 1:
                raise Malformed("a message of several parts")
            request = request_of(message[0])
        except Malformed as why:
            self._refuse(str(why))
            return None
        session = self._session(request)
        if session and request.number == session.number and session.newest:
            # It comes again: the time of this exchange, and the answer from memory.
            return self._packed(request, received, *session.newest)
        if session and request.number != session.number + 1:
            self._refuse("a call out of its order")
            return None
        try:
            kind, content = "answer", self._result(request, session)
        except FmuFault as fault:
            kind = "end" if isinstance(fault, AsksToEnd) else "fault"
            content = list(fault_fields(fault))
        except (Malformed, InputFault) as why:
            self._refuse(str(why))
            return self._packed(request, received, "refused", str(why))
        except Exception as error:  # a mistake of ours, which ends this run and no other
            return self._packed(request, received, "refused", self._give_up(request, error))
        packed = self._packed(request, received, kind, content)
        if session := self._session(request):
            session.number, session.heard = request.number, received
            session.newest = kind, content
        return packed

    def _give_up(self, request: Request, error: Exception) -> str:
        """Close the FMU of a run whose call has raised what nobody foresaw; what to tell of it."""
        why = f"{request.call} has failed in the server: {type(error).__name__}: {error}"[:1000]
        self._refuse(why)
        if session := self._session(request):
            session.phase = "closed"
            with suppress(Exception):
                session.close()
        return why

    def _packed(self, request: Request, received: int, kind: str, content: Any) -> bytes:
        times = request.number, request.sent, received, monotonic_ns()
        return Answer(*times, kind, content).packed()

    def _session(self, request: Request) -> ServedFmu | None:
        every = self._sessions.values()
        return next((s for s in every if s.identifier == request.session), None)

    def _result(self, request: Request, session: ServedFmu | None) -> Any:
        if request.call == "hello" and session is None:
            return self._loaded(request)
        if session is None:
            raise Malformed(
                "this run is not known: the server was started again, or serves another run; the "
                "state of the FMU is lost"
            )
        result = session.carry_out(request)
        if session.phase == "closed":
            self._say("a run has ended")
        return result

    def _loaded(self, request: Request) -> None:
        name, _, theirs = request.arguments
        if name not in self._fmus:
            raise Malformed(f"no FMU {name[:40]!r} here; there are {', '.join(self._fmus)}")
        fmu, ours = self._fmus[name]
        if differing := "; ".join(differences(ours, theirs)):
            raise Malformed(f"its scene is another one: {differing[:1000]}")
        before = self._sessions.get(name)
        if before and before.phase != "closed":
            silent = 1e-9 * (monotonic_ns() - before.heard)
            if silent < LEASE:
                raise Malformed(f"{name} is in use by another run, heard {silent:.1f} s ago")
            self._say(f"{name}: a run was not heard of for {silent:.0f} s: another one has it")
            del self._sessions[name]
            with suppress(FmuFault):
                before.close()
        self._sessions[name] = ServedFmu(request, fmu, self._policy)
        self._say(f"{name}: a run has begun")

    def _refuse(self, why: str) -> None:
        """Count a message that is refused; say the first of each of so many kinds."""
        if why not in self.refused:
            if len(self.refused) >= KINDS:
                why = "for further reasons"
            else:
                self._say(f"refused: {why}")
        self.refused[why] += 1


class _Holders:
    """Those who have the key, for ZeroMQ's authentication (ZAP, ZeroMQ RFC 27)."""

    def __init__(self, key: Key) -> None:
        self._key = key

    def callback(self, domain: str, key: bytes) -> bool:
        return key == self._key.public


@contextmanager
def _bind(address: str, key: Key, say: Callable[[str], object]) -> Iterator[Any]:
    """A socket that is bound to an address and admits those who have the key."""
    context = zmq.Context()
    authenticator = ThreadAuthenticator(context)
    authenticator.start()
    try:
        authenticator.configure_curve_callback("*", _Holders(key))
        socket = context.socket(zmq.ROUTER)
        for option, value in (SECURE | ALIVE | BOUNDED).items():
            setattr(socket, option, value)
        socket.curve_server, socket.curve_secretkey = True, key.secret
        try:
            socket.bind(f"tcp://{address}")
        except zmq.ZMQError as error:
            raise InputFault(f"--listen {address}: {error}: choose another") from None
        host, _, port = address.rpartition(":")
        if port == "0":  # the system has chosen one
            port = socket.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2]
        say(f"serves at {host}:{port}")
        yield socket
    finally:
        authenticator.stop()
        context.destroy(linger=0)
