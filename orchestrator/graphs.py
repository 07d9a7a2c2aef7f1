"""Who feeds whom: the order that dependencies give, and the loops in which there is none."""

from __future__ import annotations

from collections.abc import Collection, Mapping


def components(feeds: Mapping[str, Collection[str]]) -> list[list[str]]:
    """The nodes of a graph `node -> those that feed it`, each group after those that feed it.

    A group of more than one node is a loop (a strongly connected component; Tarjan 1972).
    """
    found: list[list[str]] = []
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    path: list[str] = []

    def visit(node: str) -> None:
        number[node] = lowest[node] = len(number)
        path.append(node)
        for before in (n for n in feeds[node] if n in feeds):
            if before not in number:
                visit(before)
                lowest[node] = min(lowest[node], lowest[before])
            elif before in path:
                lowest[node] = min(lowest[node], number[before])
        if lowest[node] == number[node]:
            at = path.index(node)
            found.append(sorted(path[at:], key=list(feeds).index))
            del path[at:]

    for node in feeds:
        if node not in number:
            visit(node)
    return found


def ring(feeds: Mapping[str, Collection[str]], group: Collection[str]) -> str:
    """A way round inside a loop, as `a -> b -> a`."""
    path = [next(iter(group))]
    while True:
        before = sorted(n for n in feeds[path[-1]] if n in group)[0]
        if before in path:
            return " -> ".join([before, *reversed(path[path.index(before) :])])
        path.append(before)
