"""The order of FMUs by their connections and direct feed-through, and the algebraic loops."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.system.ports import companion_outputs
from hapticlink.orchestrator.system.system import Connection, Fmu, System

Node = TypeVar("Node", bound=Hashable)


@dataclass(frozen=True)
class AlgebraicLoop:
    """FMUs that depend on each other, in the order in which they step, and one cycle of them."""

    fmus: tuple[str, ...]
    ring: str


def groups(system: System, fmus: Iterable[Fmu]) -> list[list[Fmu]]:
    """FMUs in groups, each after those that feed it; a group of several FMUs is a loop."""
    feeds = _feeds(system, [u.name for u in fmus])
    return [[system.fmu[n] for n in group] for group in components(feeds)]


def _feeds(system: System, names: Collection[str]) -> dict[str, list[str]]:
    """For each of these FMUs, those of them that feed it."""
    return {n: [c.source for c in system.into(n) if c.source in names] for n in names}


def direct(system: System, fmus: Iterable[Fmu]) -> dict[str, set[str]]:
    """For each of these FMUs, those of them on which its used outputs depend by direct feed-through
    (ModelStructure, FMI 2.0.5 section 2.2.8)."""
    names = {u.name for u in fmus}
    return {
        u.name: {
            c.source
            for c in system.into(u.name)
            if c.source in names
            and any(u.description.follows(y, c.inputs) for y in _read(system, u))
        }
        for u in fmus
    }


def _read(system: System, fmu: Fmu) -> Iterator[Scalar]:
    """The used outputs: those of connections, and those that holds read beside them."""
    for c in system.out_of(fmu.name):
        yield from c.outputs
        yield from companion_outputs(c, system.fmu)


def plants(system: System, fmus: Iterable[Fmu]) -> Iterator[list[Fmu]]:
    """Plants in the order in which they step. Within an algebraic loop, topologically by direct
    feed-through; ties keep the declaration order."""
    for group in groups(system, fmus):
        parts = components(direct(system, group))
        yield [system.fmu[name] for part in parts for name in part]


def loops(system: System, ordered: Iterable[Iterable[Fmu]]) -> Iterator[AlgebraicLoop]:
    """The loops within each group of FMUs that a scheme puts in an order."""
    for fmus in ordered:
        for group in plants(system, fmus):
            names = tuple(u.name for u in group)
            if len(names) > 1:
                yield AlgebraicLoop(names, ring(_feeds(system, names), names))


@dataclass(frozen=True)
class StartOutputs:
    """Outputs of an FMU, by their index among all, that depend in initialisation mode on what the
    same connections bring."""

    fmu: str
    outputs: tuple[int, ...]
    needs: tuple[Connection, ...]


@dataclass(frozen=True)
class StartGroup:
    """Outputs whose start values are computed together; is_loop: they depend on each other."""

    members: tuple[StartOutputs, ...]
    is_loop: bool


def order_start(system: System) -> list[StartGroup]:
    """All outputs in groups, each after those that it depends on in initialisation mode, by what
    the FMUs declare (InitialUnknowns; FMI 2.0.5 section 2.2.8, FMI 3.0 section 2.4.8)."""
    members = [part for whole in whole_fmus(system) for part in _parts(system, whole)]
    of = {
        (m.fmu, system.fmu[m.fmu].description.outputs[i].name): k
        for k, m in enumerate(members)
        for i in m.outputs
    }
    feeds = {
        k: {of[c.source, y.name] for c in m.needs for y in c.outputs} for k, m in enumerate(members)
    }
    return [
        StartGroup(tuple(members[k] for k in group), group[0] in feeds[group[0]] or len(group) > 1)
        for group in components(feeds)
    ]


def whole_fmus(system: System) -> list[StartOutputs]:
    """All outputs of each FMU, as if each of them depended on all that is connected to it."""
    incoming: dict[str, list[Connection]] = {fmu.name: [] for fmu in system.fmus}
    for c in system.connections:
        incoming[c.target].append(c)
    return [
        StartOutputs(u.name, tuple(range(len(u.description.outputs))), tuple(incoming[u.name]))
        for u in system.fmus
    ]


def _parts(system: System, whole: StartOutputs) -> Iterator[StartOutputs]:
    """The outputs of an FMU by the connections that they depend on."""
    about = system.fmu[whole.fmu].description
    for needs, outputs in about.group_at_start([c.inputs for c in whole.needs]).items():
        yield StartOutputs(whole.fmu, tuple(outputs), tuple(whole.needs[k] for k in needs))


def components(feeds: Mapping[Node, Collection[Node]]) -> list[list[Node]]:
    """The nodes of a graph `node -> those that feed it`, each group after those that feed it.

    A group of more than one node is a loop (a strongly connected component; Tarjan 1972).
    """
    groups: list[list[Node]] = []
    number: dict[Node, int] = {}
    lowest: dict[Node, int] = {}
    path: list[Node] = []

    def visit(node: Node, again: Callable[..., None]) -> None:
        number[node] = lowest[node] = len(number)
        path.append(node)
        for before in (n for n in feeds[node] if n in feeds):
            if before not in number:
                again(before, again)
                lowest[node] = min(lowest[node], lowest[before])
            elif before in path:
                lowest[node] = min(lowest[node], number[before])
        if lowest[node] == number[node]:
            begin = path.index(node)
            groups.append(sorted(path[begin:], key=list(feeds).index))
            del path[begin:]

    for node in feeds:
        if node not in number:
            visit(node, visit)  # one that refers to itself would stay until cycles are searched
    return groups


def ring(feeds: Mapping[str, Collection[str]], group: Collection[str]) -> str:
    """One cycle inside a loop, as `a -> b -> a`."""
    path = [next(iter(group))]
    while True:
        before = sorted(n for n in feeds[path[-1]] if n in group)[0]
        if before in path:
            return " -> ".join([before, *reversed(path[path.index(before) :])])
        path.append(before)
