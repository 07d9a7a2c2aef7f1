"""What ModelStructure of an FMU names: variables that it has, each once in a list."""

from __future__ import annotations

from collections.abc import Container, Iterator
from xml.etree.ElementTree import Element


def check_structure(tree: Element, version: str) -> None:
    """Raises ValueError for an unknown of no variable, one that stands twice in its list, and a
    dependency on no variable (FMI 2.0.5 section 2.2.8, by indices from 1 on; FMI 3.0 section
    2.4.8, by value references)."""
    variables = tree.findall("./ModelVariables/*")
    by_index = version == "2"
    key = "index" if by_index else "valueReference"
    known: Container[int] = range(1, len(variables) + 1)
    if not by_index:
        known = {int(v.get(key, "-1")) for v in variables}
    counted = f"from 1 to {len(variables)}" if by_index else "those of its variables"
    seen: set[tuple[str, int]] = set()
    for named, unknown in _unknowns(tree, by_index):
        number = int(unknown.get(key, "-1"))
        if number not in known:
            raise ValueError(
                f"ModelStructure: {named} of {key} {number}, where there are {counted}"
            )
        if (named, number) in seen:
            raise ValueError(f"ModelStructure: {named} of {key} {number} stands twice")
        seen.add((named, number))
        for other in map(int, (unknown.get("dependencies") or "").split()):
            if other not in known:
                raise ValueError(
                    f"ModelStructure: {named} of {key} {number} depends on {other}, where there "
                    f"are {counted}"
                )


def _unknowns(tree: Element, by_index: bool) -> Iterator[tuple[str, Element]]:
    """Each unknown with the name of its list: Outputs of FMI 2.0, Output of FMI 3.0."""
    for entry in tree.iterfind("./ModelStructure/*"):
        if by_index:
            yield from ((entry.tag, unknown) for unknown in entry)
        else:
            yield entry.tag, entry
