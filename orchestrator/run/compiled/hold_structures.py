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
from hapticlink.orchestrator.run.make_holds import WithFurther
from hapticlink.orchestrator.system.latency_and_loss import Late, SampleLink

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
    link: SampleLink | None
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


def compiled_tank(tank: EnergyTank) -> structures.Tank:
    """An energy tank in C."""
    n, near = len(tank.stiffness), tank.near
    assert isinstance(near.position, Reader)
    several = dict.fromkeys(("newest", "modulated"), 2 * n)
    several |= dict.fromkeys(("x", "moved", "force", "withheld"), n)
    c = _with_arrays(structures.Tank, several)
    c.fill(near, "period", "sampled", n=n, tick=-1)
    c.fill(tank, "least")
    constant = {"stiffness": tank.stiffness, "damping": tank.damping, "turns": near.turns}
    c.fill(near.position, "where", **{k: np.ascontiguousarray(v) for k, v in constant.items()})
    if near.velocity:
        assert isinstance(near.velocity, Reader)
        c.fill(velocity=near.velocity.where)
    return c


def _compiled_account(hold: Account, tank: structures.Tank | None) -> structures.Account:
    """The energy account of a hold in C."""
    vectors = np.zeros((19, len(hold.sample)))
    c = structures.Account(tick=-1, since=-1, passive=isinstance(hold, Passive))
    vectors[16] = 1.0 if c.passive else 0.0  # beta, or no correction
    c.fill(hold, "premises", n=len(hold.sample), vectors=vectors, tank=tank)
    for reader, of in ((hold.displacement, c.displacement), (hold.velocity, c.velocity)):
        if reader:
            assert isinstance(reader, Reader)
            fill_reader(of, reader)
    return c


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
        tank: structures.Tank | None = None,
    ) -> None:
        self.own, angles, matrix, link, further, self.far = parts(hold)
        own = self.own
        n, depth = len(held), getattr(own, "depth", 1)
        places = [*sources, *(further.where if further else ())]
        width, turned = len(places), len(angles.angles) if angles else 0
        rows = matrix.n if matrix else 0
        self._push, self._value, self._loop, self._n = library.push, library.value, loop, n
        self._width, self._further = width, further
        arrays = {"samples": depth * width, "vectors": 8 * n, "last": turned, "scale": 2 * rows}
        self._c = c = _with_arrays(structures.Hold, arrays)
        c.fill(kind=KINDS[type(own)], n=n, width=width, depth=depth)
        c.fill(sources=np.array(places, np.intp), held=held)
        if angles:
            turns = np.array(angles.turn, np.float64)
            c.fill(angles=np.array(angles.angles, np.int64), turns=turns, n_angles=turned)
        if matrix:
            c.manifold = 1 if isinstance(matrix, Projector) else 2
            c.rows, c.rank = rows, -1
        self._growing: list[tuple[structures.Structure, dict[str, int]]] = []
        self.link = self._account = None
        if link:
            self._link, self._late = link, np.zeros(DRAWN, np.int64)
            self.link = structures.Link(n_late=DRAWN, at_late=DRAWN)
            self.link.fill(late=self._late)
            self._growing = [(self.link, {"arrivals": 1, "stamps": 1, "samples": width})]
        if isinstance(own, Account):
            self._account = account = _compiled_account(own, tank)
            queues = account.path, account.until, account.fresh
            self._growing += [(queue, {"ticks": 1, "values": n}) for queue in queues]
        c.fill(link=self.link, account=self._account)
        self.room = 0
        self.grow()
        if tank and isinstance(own, PassiveSetPosition):
            c.fill(own, "row", tank=tank)
        self.address: int = ctypes.addressof(c)

    def join(self, holds: Iterable[CompiledHold]) -> None:
        """Find the account on the far side of the spring that it sets among `holds`."""
        if self.far:
            observer, credit = self.far
            accounts = {id(h.own): h._account for h in holds}
            self._c.fill(far=accounts[id(observer)], credit=credit)

    def draw(self) -> None:
        """Draw the next latencies."""
        assert self.link is not None
        self._late[:] = [self._link.draw() for _ in range(DRAWN)]
        self.link.at_late = 0

    def grow(self) -> None:
        """Make room for more samples."""
        before, self.room = self.room, 2 * self.room or FEW
        for c, widths in self._growing:  # ticks and doubles have 8 bytes both
            for name, width in widths.items():
                array = np.zeros((self.room, width))
                if before:
                    array[:before] = c.kept[name]
                c.fill(**{name: array})
        for growing in filter(None, (self.link, self._account)):
            growing.room = self.room

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
        assert len(own) == self._width
        while code := self._push(self.address, own.ctypes.data, stamp, arrival):
            self.serve(code)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        value = np.zeros(self._n)
        while code := self._value(self.address, self._loop, tick, ahead, value.ctypes.data):
            self.serve(code)
        return value


def tanks(holds: Iterable[Hold], repeats: bool) -> dict[int, structures.Tank]:
    """The energy tanks in C, by the id of the tank, of those all whose holds have C."""
    shared: dict[int, tuple[EnergyTank, list[Hold]]] = {}
    for hold in holds:
        own = parts(hold).own
        if isinstance(own, PassiveSetPosition | Account) and own.tank:
            shared.setdefault(id(own.tank), (own.tank, []))[1].append(hold)
    return {
        key: compiled_tank(tank)
        for key, (tank, of) in shared.items()
        if all(can(hold, repeats) for hold in of)
    }
