"""Holds and energy tanks as structures of the compiled loop."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import Fault, shorten
from hapticlink.orchestrator.holds.table import IN_PYTHON, ROWS, HoldRow
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.energy.bonds import Reader
from hapticlink.orchestrator.run.hold_parts import (
    HoldParts,
    SpringParts,
    describe_holds,
    describe_spring,
)
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.scene_tables import SetSpring
from hapticlink.orchestrator.system.latency_and_loss import SampleLink

FEW = 16
"""Samples that there is room for at first."""
ACCOUNT = (
    *("now", "average", "at_stamp"),
    *("sample", "held", "x", "x_stamp", "work", "ideal", "motion", "steady", "predicted", "v"),
    *("gain", "largest", "swing", "beta", "correction", "last", "travelled"),
)
"""The vectors of an energy account."""


def _with_arrays(kind: type[structures.Structure], words: Mapping[str, int]) -> Any:
    """A structure with arrays of so many zeros of 8 bytes behind it, by its pointers to them."""
    size = ctypes.sizeof(kind)
    c = kind.from_buffer(ctypes.create_string_buffer(size + 8 * sum(words.values())))
    place = ctypes.addressof(c) + size
    for name, number in words.items():
        setattr(c, name, place if number else None)
        place += 8 * number
    return c


def make_tank(parts: SpringParts) -> structures.Tank:
    """The energy tank of a spring-damper."""
    n = len(parts.stiffness)
    words = dict.fromkeys(("newest", "modulated"), 2 * n)
    words |= dict.fromkeys(("x", "moved", "force", "withheld"), n) | {"least": 1}
    c = _with_arrays(structures.Tank, words)
    c.fill(parts, "stiffness", "damping", "turns", "period", "sampled", n=n, tick=-1)
    c.fill(where=parts.position.where)
    if parts.velocity:
        c.fill(velocity=parts.velocity.where)
    return c


def fill_reader(c: structures.Reader, reader: Reader) -> None:
    """Fills the structure of a reader."""
    c.fill(reader, "where", "factor", "offset", n=len(reader.where))


def fill_generator(c: structures.Pcg64, seed: int) -> None:
    """Fills the structure of NumPy's PCG64 with a seed."""
    state = np.random.PCG64(seed).state["state"]
    for words, number in ((c.state, state["state"]), (c.increment, state["inc"])):
        words[:] = divmod(number, 2**64)


class CompiledHold:
    """A hold of the loop at address `loop`, whose `evaluate` puts its value into `held`.

    c: its structure, at `address`. places: the indices of a sample's entries among the signals.
    own: the hold of a plugin that is called back, else None; error: what that has raised. premises:
    of a hold that observes its energy, the steps by entry so far, how many of them were outside the
    premises of the hold, or of its tank, and the energy (J) that such steps can have generated
    beyond what is proved.
    """

    def __init__(
        self,
        library: ctypes.CDLL,
        loop: int,
        parts: HoldParts,
        held: Vector,
        connection: str = "",
        tank: structures.Tank | None = None,
    ) -> None:
        self.parts, self.tank, self._connection = parts, tank, connection
        own = isinstance(parts.kind, HoldRow)
        self.row = row = parts.kind if isinstance(parts.kind, HoldRow) else IN_PYTHON
        n, places, turned = len(held), [*parts.sources, *parts.further], len(parts.turns)
        width, rows = len(places), math.isqrt(n) if parts.matrix else 0
        self._push, self._value, self._loop, self._n = library.push, library.value, loop, n
        self.width, self.places = width, np.array(places, np.intp)
        words = {"samples": row.depth * width, "memory": row.remembers * n}
        words["scratch"] = 6 * n + width
        words |= {"last": turned, "chosen": rows}
        words["scale"] = rows if parts.matrix == "semidefinite" else 0
        self.c = c = _with_arrays(structures.Hold, words)
        c.fill(row, "depth", "remembers", kind=ROWS.index(row), n=n, width=width)
        c.fill(sources=self.places, held=held, frames=parts.frames)
        if turned:
            angles, turns = np.array([*parts.turns]), np.array([*parts.turns.values()])
            c.fill(angles=angles.astype(np.int64), turns=turns, n_angles=turned)
        if parts.matrix:
            kinds = {"projector": structures.PROJECTOR, "semidefinite": structures.SEMIDEFINITE}
            c.fill(manifold=kinds[parts.matrix], rows=rows, rank=-1)
        if parts.beside:
            fill_reader(c.beside, parts.beside)
        if parts.gains:
            c.fill(stiffness=parts.gains[0], damping=parts.gains[1])
        c.fill(relation=getattr(structures, parts.relation), parts=parts.parts)
        c.fill(early=row.needs == "step")
        self._growing: list[tuple[structures.Structure, dict[str, int]]] = []
        self.link: Any = None
        self.account: Any = None
        self.premises: Vector | None = None
        self.own: Any = None
        if parts.latency:
            link = SampleLink(parts.latency, parts.base)
            low, spread, unit = link.whole_numbers()
            self.link = structures.Link(low=low, spread=spread, unit=unit, loss=link.latency.loss)
            fill_generator(self.link.generator, link.latency.seed)
            self._growing = [(self.link, {"arrivals": 1, "stamps": 1, "samples": width})]
        if own and row.needs == "power":
            self.account = account = self._make_account(n, tank)
            queues = account.path, account.until, account.fresh
            self._growing += [(queue, {"ticks": 1, "values": n}) for queue in queues]
        c.fill(link=self.link, account=self.account)
        self.room = 0
        self.grow()
        if tank and row.needs == "spring":
            c.fill(parts, "row", tank=tank)
        self.error: BaseException | None = None
        if not own:
            self._call_back(parts.kind)
        self.address: int = ctypes.addressof(c)

    def _make_account(self, n: int, tank: structures.Tank | None) -> Any:
        account = _with_arrays(structures.Account, dict.fromkeys(ACCOUNT, n) | {"premises": 3})
        account.fill(n=n, tick=-1, since=-1, passive=self.row.value == "passive", tank=tank)
        array(account.beta, n)[:] = 1.0
        self.premises = array(account.premises, 3)
        parts = self.parts
        for reader, of in (
            (parts.displacement, account.displacement),
            (parts.velocity, account.velocity),
        ):
            if reader:
                fill_reader(of, reader)
        return account

    # --- holds of plugins -----------------------------------------------------------------

    def _call_back(self, kind: Any) -> None:
        """Has the loop call a hold of a plugin, which `kind` makes."""
        integer, number, pointer = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p

        def restart() -> None:
            self.own = kind(self.parts.context)

        def take(stamp: int, sample: int, arrival: int) -> None:
            self.own.push(stamp, array(sample, self.width), arrival)

        def give(tick: int, ahead: float, value: int) -> None:
            array(value, self._n)[:] = self._checked(self.own.value(tick, ahead))

        self.own = kind(self.parts.context)
        self.c.fill(
            restart=ctypes.CFUNCTYPE(ctypes.c_int)(self._guarded(restart)),
            take=ctypes.CFUNCTYPE(ctypes.c_int, integer, pointer, integer)(self._guarded(take)),
            give=ctypes.CFUNCTYPE(ctypes.c_int, integer, number, pointer)(self._guarded(give)),
        )

    def _guarded(self, call: Callable[..., None]) -> Callable[..., int]:
        """The call with its status, as no exception passes through C."""

        def guarded(*arguments: Any) -> int:
            try:
                call(*arguments)
            except BaseException as error:
                self.error = error
                return 1
            return 0

        return guarded

    def _checked(self, value: Any) -> Vector:
        """Raises Fault, which names the hold and its connection, for what is no vector of finite
        numbers."""
        if (
            not isinstance(value, np.ndarray)
            or value.shape != (self._n,)
            or value.dtype.kind not in "fiu"
            or not np.isfinite(value).all()
        ):
            raise Fault(
                f"hold {self.parts.name!r} of {self._connection}: its value is "
                f"{shorten(' '.join(repr(value).split()))}, where {self._n} finite numbers in "
                "a NumPy array are needed"
            )
        return value

    # --- what the loop needs ----------------------------------------------------------------

    def grow(self) -> None:
        """Make room for more samples."""
        before, self.room = self.room, 2 * self.room or FEW
        for c, widths in self._growing:  # ticks and doubles have 8 bytes both
            for name, width in widths.items():
                array = np.zeros((self.room, width))
                if before:
                    array[:before] = c.kept[name]
                c.fill(**{name: array})
        for growing in filter(None, (self.link, self.account)):
            growing.room = self.room

    def counted(self) -> dict[str, Any]:
        """What it has counted and drawn, which its values do not depend on otherwise: it is no part
        of the state that a `StateBlock` has."""
        found: dict[str, Any] = {"room": self.room}
        found["published"] = [self.c.published, self.c.describes]
        if link := self.link:
            found["link"] = [link.sent, link.lost, link.overtaken]
            found["drawn"] = [*link.generator.state, *link.generator.increment]
        if self.premises is not None:
            found["premises"] = self.premises.copy()
        return found

    def restore_published(self, counted: Mapping[str, Any]) -> None:
        """Know when the source had its newest sample, as whatever hold takes the place of this."""
        self.c.published, self.c.describes = counted["published"]

    def restore_counted(self, counted: Mapping[str, Any]) -> None:
        """Have counted and drawn the same, with room for as many samples."""
        while self.room < counted["room"]:
            self.grow()
        if link := self.link:
            link.sent, link.lost, link.overtaken = counted["link"]
            link.generator.state[:] = counted["drawn"][:2]
            link.generator.increment[:] = counted["drawn"][2:]
        if self.premises is not None:
            self.premises[:] = counted["premises"]

    def serve(self, code: int) -> None:
        """Do what `push` or `value` in C have returned for. Raises what the hold of a plugin has
        raised."""
        if code == structures.GROW:
            self.grow()
        else:
            assert self.error is not None
            raise self.error

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        """Take a whole sample, with what belongs to it besides: as `Hold.push`."""
        own = np.ascontiguousarray(sample, np.float64)
        assert len(own) == self.width
        while code := self._push(self.address, own.ctypes.data, stamp, arrival):
            self.serve(code)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        """As `Hold.value`."""
        value = np.zeros(self._n)
        while code := self._value(self.address, self._loop, tick, ahead, value.ctypes.data):
            self.serve(code)
        return value


def make_holds(
    library: ctypes.CDLL, loop: structures.Loop, signals: SignalVector
) -> tuple[dict[str, CompiledHold], list[structures.Tank]]:
    """The hold of each connection by name, and the energy tanks, each shared by the holds of one
    spring-damper."""
    every = describe_holds(signals)
    set_by_holds = [parts.spring for parts in every.values() if parts.kind.needs == "spring"]
    tanks: dict[SetSpring | None, structures.Tank] = {
        of: make_tank(describe_spring(of, signals)) for of in set_by_holds if of
    }
    holds = {
        name: make_hold(library, loop, parts, name, signals, tanks.get(parts.spring))
        for name, parts in every.items()
    }
    for hold in holds.values():
        if hold.parts.far:
            hold.c.fill(far=holds[hold.parts.far].account)
            hold.c.fill(credit=signals.values[hold.places[-1:][0] :])
    return holds, [*tanks.values()]


def make_hold(
    library: ctypes.CDLL,
    loop: structures.Loop,
    parts: HoldParts,
    connection: str,
    signals: SignalVector,
    tank: structures.Tank | None = None,
) -> CompiledHold:
    """The hold of a connection."""
    held, address = signals.values[signals.hold(connection)], ctypes.addressof(loop)
    return CompiledHold(library, address, parts, held, connection, tank)


def array(address: int, n: int) -> Vector:
    """The doubles at an address."""
    return np.frombuffer(memoryview((ctypes.c_double * n).from_address(address)))
