"""The lifted map at rest as the product of its operations, with other hands in place of its own.

At an equilibrium an operation meets the same numbers whenever it occurs, with samples of the same
ages, so that it has the same slopes J and errors E: each is differentiated once. Events with the
same operations are one matrix, and the period is their product

    A = C_m ... C_1,   D = sum over i of C_m ... C_{i+1} E_i C_{i-1} ... C_1

over those coordinates alone that are read before they are overwritten, in this period or a later
one. What a hand is, linear and with a wrench that the equilibrium needs, changes nothing but the
matrices of its own doStep and get: one recorded period serves every hand, and what comes between
these is multiplied once for all hands.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, groupby, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.stability.forward_sensitivity import Applied
from hapticlink.analysis.stability.hand_slopes import PORTS, HandSlopes
from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.modes import Linearisation, Mode, constant, with_turns
from hapticlink.analysis.stability.state_vector import SIGNALS
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.plan.operations import OfFmu, Set, Step

Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Act:
    """An operation on perturbations: the rows `into` become J times the rows `of`."""

    into: Rows
    of: Rows
    J: Matrix
    E: Matrix

    @cached_property
    def exact(self) -> bool:
        """Whether J has no error."""
        return not self.E.any()

    @cached_property
    def depends(self) -> NDArray[np.bool_]:
        """Which rows depend on which."""
        return np.asarray((self.J != 0.0) | (self.E != 0.0))


@dataclass(frozen=True, eq=False)
class _Step:
    """An event, or several that follow each other: C and E of the rows that are read later by those
    `before` it."""

    before: Rows
    C: Matrix
    E: Matrix

    def then(self, later: _Step) -> _Step:
        """This and a `later` one as one."""
        return _Step(self.before, later.C @ self.C, later.C @ self.E + later.E @ self.C)


@dataclass(frozen=True)
class LinearPeriod:
    """The period of a map that rests at `point`: the acts of each event, on `rows` numbers."""

    map_: LiftedMap
    point: Vector
    moved: float
    """The largest change of a state or input within a few events, relative to max(1, |z|)."""
    events: tuple[tuple[Act, ...], ...]
    """Equal ones are the same object."""
    rows: int
    sources: Mapping[Act, tuple[type, str]]
    """Of the acts of FMUs: doStep, get or set, and the FMU."""
    first: Mapping[str, int]
    """The first row of an FMU, and of the signals."""
    order: Rows
    """The row of each coordinate of the map."""

    def fused(self, fmus: Container[str]) -> LinearPeriod:
        """The same period in which acts that follow each other are one, but for the doSteps and
        gets of FMUs in whose place hands can be put."""
        ports = {
            act for act, (kind, owner) in self.sources.items() if owner in fmus and kind is not Set
        }
        live, made = self._live(ports), dict[tuple[Any, ...], Act]()

        def fuse(event: Sequence[Act], live: NDArray[np.bool_]) -> Iterator[Act]:
            """Acts in the place of those of an event, the last one first."""
            for at_port, acts in groupby(reversed(event), ports.__contains__):
                run = [*acts][::-1]
                if at_port:
                    yield from reversed(run)
                else:
                    key = *run, live.tobytes()
                    if key not in made:
                        made[key] = self._as_one(run, live)
                    yield made[key]
                live = _before(run, live, ports)

        known: dict[tuple[int, bytes], tuple[Act, ...]] = {}
        equal: dict[tuple[Act, ...], tuple[Act, ...]] = {}
        for event, after in zip(self.events, live[1:], strict=True):
            if (id(event), after) not in known:
                acts = [act for act in fuse(event, np.frombuffer(after, bool)) if len(act.into)]
                fused = tuple(reversed(acts))
                known[id(event), after] = equal.setdefault(fused, fused)
        events = (
            known[id(event), after] for event, after in zip(self.events, live[1:], strict=True)
        )
        sources = {act: self.sources[act] for act in ports}
        return replace(self, events=tuple(events), sources=sources)

    def _as_one(self, acts: Sequence[Act], live: NDArray[np.bool_]) -> Act:
        """Acts that follow each other as one, which writes what is read behind them."""
        written = np.zeros(self.rows, dtype=bool)
        for act in acts:
            written[act.into] = True
        needed = written & live
        into, of = np.flatnonzero(needed), np.flatnonzero(_before(acts, needed))
        step = self._step(acts, of, into)
        return Act(into, of, step.C, step.E)

    def held(self, hands: Mapping[str, HandSlopes]) -> LinearPeriod:
        """The same period with other hands, by the FMUs in whose place they are."""
        made: dict[Act, Act] = {}
        rows = self.rows
        for fmu, hand in hands.items():
            own = range(self.first[fmu], self.first[fmu] + PORTS)
            further = range(rows, rows + hand.states)
            rows += hand.states
            mine = np.array([*own, *further], dtype=np.intp)
            for act, (kind, owner) in self.sources.items():
                if owner != fmu or kind is Set:
                    continue
                written = act.into[act.into >= self.first[SIGNALS]]
                into = mine if kind is Step else np.concatenate([mine, written])
                J = hand.step if kind is Step else hand.get
                made[act] = Act(into, mine, J, np.zeros_like(J))
        return self._with(made, rows)

    def delayed(self, fmu: str, ticks: int) -> LinearPeriod:
        """The same period in which all that an FMU reads comes as many of its steps later."""
        made: dict[Act, Act] = {}
        late = self.rows
        rows = self.rows
        for act, (kind, owner) in self.sources.items():
            if kind is not Set or owner != fmu:
                continue
            n = len(act.into)  # its own numbers, the first of what it reads
            sent = np.flatnonzero((act.J[:, n:] != 0.0).any(axis=1))
            m = len(sent)
            kept = np.arange(late, late + m * ticks, dtype=np.intp)
            rows = max(rows, late + len(kept))
            J, E = np.zeros((2, n + len(kept), len(act.of) + len(kept)))
            J[:n, :n], E[:n, :n] = act.J[:, :n], act.E[:, :n]
            J[sent, -m + np.arange(m)] = 1.0
            J[n : n + m, n : len(act.of)] = act.J[sent, n:]
            E[n : n + m, n : len(act.of)] = act.E[sent, n:]
            shift = np.arange(m * (ticks - 1))
            J[n + m + shift, len(act.of) + shift] = 1.0
            made[act] = Act(np.append(act.into, kept), np.append(act.of, kept), J, E)
        return self._with(made, rows)

    def _with(self, made: Mapping[Act, Act], rows: int) -> LinearPeriod:
        kinds = {id(event): event for event in self.events}
        others = {k: tuple(made.get(act, act) for act in event) for k, event in kinds.items()}
        events = tuple(others[id(event)] for event in self.events)
        sources = {made.get(act, act): source for act, source in self.sources.items()}
        return replace(self, events=events, rows=rows, sources=sources)

    @cached_property
    def linear(self) -> Linearisation:
        """The linearisation over the coordinates that act on themselves."""
        whole = _product(self._steps, self.map_.work.counts)
        taken, A, D = whole.before, whole.C, whole.E
        kept = ~constant(A, np.ones(len(A), dtype=bool))
        V = np.zeros((self.rows, np.count_nonzero(kept)))
        V[taken[kept], np.arange(V.shape[1])] = 1.0
        A, D = A[np.ix_(kept, kept)], D[np.ix_(kept, kept)]
        point = np.zeros(len(V))
        point[self.order] = self.point
        return Linearisation(point, point, V, A, D)

    def carried(
        self, X: Matrix, after: Callable[[type, str, Matrix], None] = lambda kind, fmu, X: None
    ) -> Matrix:
        """Perturbations X (rows, k) at the begin of the period, at its end. `after` each doStep,
        get and set of an FMU is called with them, and may change them."""
        X = X.copy()
        for act in chain.from_iterable(self.events):
            X[act.into] = act.J @ X[act.of]
            if act in self.sources:
                after(*self.sources[act], X)
        return X

    def traced(self, mode: Mode) -> Mode:
        """A mode with its frequency beyond the argument of its eigenvalue, from the phase of the
        number with the largest share of those that act all through the period."""
        always = set(self._steps[0].before.tolist())
        for step in self._steps:
            always &= set(step.before.tolist())
        share = dict(zip(self.linear.taken.tolist(), mode.participation.tolist(), strict=True))
        row = max(always & share.keys(), key=lambda i: share[i], default=None)
        if row is None or self.map_.events == 1:
            return mode
        x, path = mode.vector[self._steps[0].before], [mode.vector[row]]
        for step, after in pairwise([*self._steps, self._steps[0]]):
            x = step.C @ x
            path.append(x[int(np.searchsorted(after.before, row))])
        return with_turns(mode, np.array(path), self.map_.period)

    @property
    def in_map(self) -> Linearisation:
        """`linear` along the coordinates of the map, with the hand that it has."""
        return replace(self.linear, point=self.point, image=self.point, V=self.linear.V[self.order])

    def names(self) -> list[str]:
        """Those of the coordinates of `linear`."""
        named = {int(row): str(c) for row, c in zip(self.order, self.map_.coordinates, strict=True)}
        return [named.get(int(row), "hand.arm") for row in self.linear.taken]

    @cached_property
    def _steps(self) -> list[_Step]:
        """The events, between the coordinates that are read later."""
        live = self._live()
        known: dict[tuple[int, bytes, bytes], _Step] = {}
        steps = []
        for event, (start, end) in zip(self.events, pairwise(live), strict=True):
            key = id(event), start, end
            if key not in known:
                both = (np.flatnonzero(np.frombuffer(rows, bool)) for rows in (start, end))
                known[key] = self._step(event, *both)
            steps.append(known[key])
        return steps

    def _step(self, event: Sequence[Act], start: Rows, end: Rows) -> _Step:
        self.map_.work.counts["products"] += 1
        X, D = np.zeros((2, self.rows, len(start)))
        X[start, np.arange(len(start))] = 1.0
        for act in event:
            x, d = X[act.of], act.J @ D[act.of]
            X[act.into], D[act.into] = act.J @ x, d if act.exact else d + act.E @ x
        return _Step(start, X[end], D[end])

    def _live(self, readers_of_all: Container[Act] = ()) -> list[bytes]:
        """Which rows are read before they are overwritten, from the start of each event on, and
        behind the last one. `readers_of_all` read each of their rows, whatever J they have."""
        known: dict[tuple[int, bytes], bytes] = {}
        live = np.zeros(self.rows, dtype=bool)
        for act in chain.from_iterable({id(event): event for event in self.events}.values()):
            live[act.of] = True
        while True:
            starts = [live.tobytes()]
            for event in reversed(self.events):
                key = id(event), starts[-1]
                if key not in known:
                    after = np.frombuffer(starts[-1], bool)
                    known[key] = _before(event, after, readers_of_all).tobytes()
                starts.append(known[key])
            if starts[-1] == starts[0]:
                return starts[::-1]
            live &= np.frombuffer(starts[-1], bool)


def _product(steps: Sequence[_Step], counts: Counter[str]) -> _Step:
    """All steps as one. The pair that follows each other most often is multiplied once for all its
    places, again and again, so that equal frames share their products, and equal steps powers."""
    while len(steps) > 1:
        (first, later), _ = Counter(pairwise(steps)).most_common(1)[0]
        both, merged = first.then(later), list[_Step]()
        counts["products"] += 1
        for step in steps:
            # A product cannot be the first of this pair: each is new.
            if merged and merged[-1] is first and step is later:
                merged[-1] = both
            else:
                merged.append(step)
        steps = merged
    return steps[0]


def _before(
    event: Sequence[Act], live: NDArray[np.bool_], readers_of_all: Container[Act] = ()
) -> NDArray[np.bool_]:
    """Which rows are read from the start of an event on, of those `live` behind it."""
    live = live.copy()
    for act in reversed(event):
        read = act in readers_of_all or act.depends[live[act.into]].any(axis=0)
        live[act.into] = False
        live[act.of] |= read
    return live


def linear_period(map_: LiftedMap, point: Vector) -> LinearPeriod:
    """The period of the map from a `point` on at which it rests."""
    moved, events = map_.recorded(point)
    sizes: dict[str, int] = dict(map_.sizes())
    kinds = {id(event): event for event in events}
    for applied in chain.from_iterable(kinds.values()):
        for owner, *both in zip(applied.owners, applied.before, applied.after, strict=True):
            sizes[owner] = max(sizes.get(owner, 0), *both)
    places = np.concatenate([[0], np.cumsum(list(sizes.values()))])
    first = dict(zip(sizes, places.tolist(), strict=False))
    made: dict[int, Act] = {}
    equal_acts: dict[tuple[Any, ...], Act] = {}
    equal_events: dict[tuple[Act, ...], tuple[Act, ...]] = {}
    sources: dict[Act, tuple[type, str]] = {}

    def act(applied: Applied) -> Act:
        if id(applied) not in made:
            operation, source = applied.operation, None
            if isinstance(operation, OfFmu):
                source = type(operation), operation.fmu
            into = _rows(applied, first, applied.after, applied.writes)
            of = _rows(applied, first, applied.before, applied.reads)
            parts = into, of, applied.J, applied.E
            key = source, *(part.tobytes() for part in parts)
            made[id(applied)] = new = equal_acts.setdefault(key, Act(*parts))
            if source:
                sources[new] = source
        return made[id(applied)]

    acts = {}
    for k, event in kinds.items():
        each = tuple(map(act, event))
        acts[k] = equal_events.setdefault(each, each)
    order = np.concatenate(
        [np.arange(first[owner], first[owner] + n) for owner, n in map_.sizes().items()]
    ).astype(np.intp)
    period = tuple(acts[id(event)] for event in events)
    return LinearPeriod(map_, point, moved, period, int(places[-1]), sources, first, order)


def _rows(applied: Applied, first: Mapping[str, int], counts: Sequence[int], signals: Rows) -> Rows:
    starts = (first[owner] for owner in applied.owners)
    own = [start + np.arange(n) for start, n in zip(starts, counts, strict=True)]
    return np.concatenate([*own, signals + first[SIGNALS]]).astype(np.intp)
