"""Holds in C, made from those in Python, which are their specification."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.energy_account import Account
from hapticlink.orchestrator.holds.energy_tank import EnergyTank
from hapticlink.orchestrator.holds.hold import Hold, Vector
from hapticlink.orchestrator.holds.holds_on_manifolds import Projector, Semidefinite, Unwrapped
from hapticlink.orchestrator.holds.passive import Passive
from hapticlink.orchestrator.holds.passive_set_position import PassiveSetPosition
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.energy.bonds import Reader
from hapticlink.orchestrator.run.spring_holds import WithFurther
from hapticlink.orchestrator.system.latency_and_loss import Late, Link

KINDS: Mapping[type[Hold], int] = {
    HOLDS[name]: kind
    for name, kind in {
        "zoh": structures.ZERO_ORDER,
        "latest": structures.ZERO_ORDER,
        "lead": structures.LEAD,
        "foh": structures.FIRST_ORDER,
        "foh-derivative": structures.FIRST_ORDER_DERIVATIVE,
        "second-order": structures.SECOND_ORDER,
        "hermite": structures.HERMITE,
        "slope": structures.SLOPE,
        "delayed": structures.DELAYED,
        "smooth": structures.SMOOTH,
        "mean": structures.MEAN,
        "pspm": structures.PASSIVE_SET_POSITION,
        "passive": structures.OBSERVED,
        "nepce": structures.OBSERVED,
    }.items()
}
"""The holds that have C, with their names in loop.h."""
DRAWN, FEW = 256, 16
"""Latencies that are drawn at a time, and samples that there is room for at first."""


class Parts(NamedTuple):
    """What a hold is made of: its own class, and what wraps it."""

    own: Hold
    angles: Unwrapped | None
    matrix: Projector | Semidefinite | None
    link: Link | None
    further: Reader | None
    far: tuple[Account, Vector] | None
    """The account on the far side of the spring that it sets, and where its energy is written."""


def parts(hold: Hold) -> Parts:
    """The parts of a hold that `make_hold` has made; `own` is a wrapper that has no C where one is
    left."""
    further, link, angles, matrix, far = None, None, None, None, None
    if isinstance(hold, WithFurther):
        further, far, hold = hold.further, hold.account, hold.hold
    if isinstance(hold, Late):
        link, hold = hold.link, hold.hold
    if isinstance(hold, Unwrapped):
        angles = hold
        hold = hold.hold
    elif isinstance(hold, Projector | Semidefinite):
        matrix = hold
        hold = hold.hold
    return Parts(hold, angles, matrix, link, further, far)


def can(hold: Hold, repeats: bool) -> bool:
    """Whether there is C for a hold: not for classes of plugins, not for matrices whose hold needs
    more than their samples, and not for samples in transit or an energy account where steps are
    repeated."""
    pieces = parts(hold)
    if pieces.matrix and pieces.own.needs:
        return False
    grows = pieces.link or isinstance(pieces.own, Account)
    return type(pieces.own) in KINDS and not (grows and repeats)


def _with_arrays(kind: type[structures.Structure], words: Mapping[str, int]) -> Any:
    """A structure with arrays of so many zeros of 8 bytes behind it, by its pointers to them."""
    size = ctypes.sizeof(kind)
    c = kind.from_buffer(ctypes.create_string_buffer(size + 8 * sum(words.values())))
    place = ctypes.addressof(c) + size
    for name, number in words.items():
        setattr(c, name, place if number else None)
        place += 8 * number
    return c


class CompiledTank:
    """An energy tank in C."""

    def __init__(self, tank: EnergyTank) -> None:
        n, near = len(tank.stiffness), tank.near
        assert isinstance(near.position, Reader)
        several = dict.fromkeys(("newest", "modulated"), 2 * n)
        several |= dict.fromkeys(("x", "moved", "force", "withheld"), n)
        self.c = c = _with_arrays(structures.Tank, several)
        self._kept = tuple(map(np.ascontiguousarray, (tank.stiffness, tank.damping, near.turns)))
        self._readers = near.position, near.velocity
        stiffness, damping, turns = self._kept
        c.fill(near, "period", "sampled", n=n, tick=-1)
        c.fill(tank, "least")
        c.fill(near.position, "where", stiffness=stiffness, damping=damping, turns=turns)
        if near.velocity:
            assert isinstance(near.velocity, Reader)
            c.fill(velocity=near.velocity.where)


class Grown:
    """Arrays of a structure that grow with a run: fields of vectors, with a row's length."""

    def __init__(self, c: structures.Structure, fields: Mapping[str, int]) -> None:
        self._c, self._fields = c, fields
        self._arrays = {name: np.zeros((0, width)) for name, width in fields.items()}

    def to(self, room: int) -> None:
        """Give them room for `room` rows."""
        for name, width in self._fields.items():
            array = np.zeros((room, width))
            array[: len(self._arrays[name])] = self._arrays[name]
            self._arrays[name] = array
            self._c.fill(**{name: array})


class CompiledAccount:
    """The energy account of a hold in C."""

    def __init__(self, hold: Account) -> None:
        n = len(hold.sample)
        self.c = c = structures.Account(n=n, tick=-1, since=-1, passive=isinstance(hold, Passive))
        self._vectors = np.zeros((19, n))
        self._vectors[16] = 1.0 if c.passive else 0.0  # beta, or no correction
        c.fill(hold, "premises", vectors=self._vectors)
        self._readers = hold.displacement, hold.velocity
        for reader, of in zip(self._readers, (c.displacement, c.velocity), strict=True):
            if reader:
                assert isinstance(reader, Reader)
                fill_reader(of, reader)
        # Ticks and doubles have 8 bytes both.
        self._queues = [Grown(q, {"ticks": 1, "values": n}) for q in (c.path, c.until, c.fresh)]

    def to(self, room: int) -> None:
        for queue in self._queues:
            queue.to(room)
        self.c.room = room


def fill_reader(c: structures.Reader, reader: Reader) -> None:
    """Fills the structure of a reader."""
    c.fill(reader, "where", "factor", "offset", n=len(reader.where))


class CompiledHold(Hold):
    """A hold in C. sources: the indices of its samples in the signal vector; held: where `evaluate`
    puts its value. loop: the address of the Loop that it runs in."""

    def __init__(
        self,
        library: ctypes.CDLL,
        loop: int,
        hold: Hold,
        sources: Sequence[int],
        held: Vector,
        tank: CompiledTank | None = None,
    ) -> None:
        self.own, angles, matrix, link, further, self.far = parts(hold)
        own = self.own
        n, depth = len(held), getattr(own, "depth", 1)
        places = [*sources, *(further.where if further else ())]
        width, turned = len(places), len(angles.angles) if angles else 0
        rows = matrix.n if matrix else 0
        self._push, self._value, self._loop, self._n = library.push, library.value, loop, n
        self._sources, self._further = np.array(places, np.intp), further
        self._held, self._tank = held, tank
        arrays = {"samples": depth * width, "vectors": 8 * n, "last": turned, "scale": 2 * rows}
        self._c = c = _with_arrays(structures.Hold, arrays)
        c.fill(kind=KINDS[type(own)], n=n, width=width, depth=depth)
        c.fill(sources=self._sources, held=held)
        if angles:
            self._angles = np.array(angles.angles, np.int64), np.array(angles.turn, np.float64)
            c.fill(angles=self._angles[0], turns=self._angles[1], n_angles=turned)
        if matrix:
            c.manifold = 1 if isinstance(matrix, Projector) else 2
            c.rows, c.rank = rows, -1
        self.link = None
        if link:
            self._link, self._late = link, np.zeros(DRAWN, np.int64)
            self.link = k = structures.Link(n_late=DRAWN, at_late=DRAWN)
            k.fill(late=self._late)
            c.fill(link=k)
            self._transit = Grown(k, {"arrivals": 1, "stamps": 1, "samples": width})
        self._account = None
        if isinstance(own, Account):
            self._account = CompiledAccount(own)
            c.fill(account=self._account.c)
            self._account.c.fill(tank=tank and tank.c)
        self.room = 0
        self.grow()
        if tank and isinstance(own, PassiveSetPosition):
            c.fill(own, "row", tank=tank.c)
        self.address: int = ctypes.addressof(c)

    def join(self, holds: Iterable[CompiledHold]) -> None:
        """Find the account on the far side of the spring that it sets among `holds`."""
        if self.far:
            observer, credit = self.far
            accounts = {id(h.own): h._account for h in holds}
            account = accounts[id(observer)]
            assert account
            self._c.fill(far=account.c, credit=credit)

    def draw(self) -> None:
        """Draw the next latencies."""
        assert self.link is not None
        self._late[:] = [self._link.draw() for _ in range(DRAWN)]
        self.link.at_late = 0

    def grow(self) -> None:
        """Make room for more samples."""
        self.room = 2 * self.room or FEW
        if self.link is not None:
            self._transit.to(self.room)
            self.link.room = self.room
        if self._account:
            self._account.to(self.room)

    def serve(self, code: int) -> None:
        """Do what `push` or `value` in C have returned for."""
        if code == structures.DRAW:
            self.draw()
        else:
            assert code == structures.GROW
            self.grow()

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if self._further:
            sample = np.concatenate([sample, self._further()])
        own = np.ascontiguousarray(sample, np.float64)
        assert len(own) == len(self._sources)
        while code := self._push(self.address, own.ctypes.data, stamp, arrival):
            self.serve(code)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        value = np.zeros(self._n)
        while code := self._value(self.address, self._loop, tick, ahead, value.ctypes.data):
            self.serve(code)
        return value


def tanks(holds: Iterable[Hold], repeats: bool) -> dict[int, CompiledTank]:
    """The energy tanks in C, by the id of the tank, of those all whose holds have C."""
    shared: dict[int, tuple[EnergyTank, list[Hold]]] = {}
    for hold in holds:
        own = parts(hold).own
        if isinstance(own, PassiveSetPosition | Account) and own.tank:
            shared.setdefault(id(own.tank), (own.tank, []))[1].append(hold)
    return {
        key: CompiledTank(tank)
        for key, (tank, of) in shared.items()
        if all(can(hold, repeats) for hold in of)
    }
