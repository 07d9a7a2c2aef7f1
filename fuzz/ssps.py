"""Exported SSPs with bytes, structure or annotation changed, each run by the command."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator
from html import escape, unescape
from xml.etree import ElementTree

import hapticlink as hl
from fuzz import mutations
from fuzz.archives import entries, zipped
from fuzz.cases import Made
from fuzz.commands import Place
from fuzz.processes import own_folder

SCENES = ("pendulum", "sampled-spring", "closed-loop-ideal")
KINDS = ("bytes", "text", "elements", "annotation", "description", "nested")
STRUCTURE, DESCRIPTION = "SystemStructure.ssd", "modelDescription.xml"
_SCENE = re.compile(r"(<hapticlink:Scene>)(.*?)(</hapticlink:Scene>)", re.DOTALL)
XML = (
    *(
        'encoding="martian"',
        "<!DOCTYPE a>",
        "&#0;",
        "&lol;",
        "<a>",
        "]]>",
        "1e999",
        "NaN",
        "-1",
        "0",
    ),
    *("4294967297", "2147483649", "9" * 5000, "x" * 5000, "../../etc/passwd", "/etc/passwd"),
)
"""Words that hurt where an attribute or some text stands."""


def elements(text: bytes, draw: random.Random) -> bytes:
    """XML with an element or attribute dropped, doubled, moved or of another value."""
    root = ElementTree.fromstring(text)
    every = [*root.iter()]
    for _ in range(draw.choice((1, 1, 2, 3))):
        node, other = draw.choice(every), draw.choice(every)
        how = draw.randrange(6)
        if how == 0 and len(node):
            node.remove(draw.choice([*node]))
        elif how == 1 and len(node):
            node.append(draw.choice([*node]))
        elif how == 2 and node is not other and other not in [*node.iter()]:
            other.append(node) if node not in [*other.iter()] else None
        elif node.attrib:
            key = draw.choice([*node.attrib])
            values = [v for e in every for v in e.attrib.values()]
            if how == 3:
                del node.attrib[key]
            else:
                words = [*XML, *mutations.TEXTS, draw.choice(values), draw.choice(values)]
                word = re.sub("[^\t\n -\ud7ff]", "", draw.choice(words))
                node.set(key, mutations.text(node.attrib[key], draw) if how == 4 else word)
    return ElementTree.tostring(root, encoding="utf-8")


def text(content: bytes, draw: random.Random) -> bytes:
    """XML that may be none any more."""
    found = content.decode()
    for _ in range(draw.choice((1, 2))):
        if draw.random() < 0.5:
            i = draw.randrange(len(found))
            found = found[:i] + draw.choice(XML) + found[i:]
        else:
            found = mutations.lines(found, draw)
    return found.encode(errors="replace")


def annotation(content: bytes, draw: random.Random) -> bytes:
    def change(match: re.Match[str]) -> str:
        tables = json.loads(unescape(match[2]))
        for _ in range(draw.choice((1, 1, 2, 3))):
            tables, _ = mutations.mutated(tables, draw)
        made = json.dumps(tables)
        made = mutations.text(made, draw) if draw.random() < 0.2 else made
        return match[1] + escape(re.sub("[^\t\n -\ud7ff]", "", made)) + match[3]

    return _SCENE.sub(change, content.decode()).encode(errors="replace")


CHANGES = {"text": text, "elements": elements, "annotation": annotation}


def nested(files: dict[str, bytes], draw: random.Random) -> dict[str, bytes]:
    """The document with further files in it that name each other, or it, once or more often."""
    space = "http://ssp-standard.org/SSP1/SystemStructureDescription"
    depth, width = draw.choice((1, 5, 12, 31, 40)), draw.choice((1, 2, 3, 50))
    for i in range(depth):
        after = draw.choice((f"{i + 1}.ssd", f"{i + 1}.ssd", f"{draw.randrange(depth)}.ssd"))
        parts = "".join(
            f'<ssd:Component name="c{k}" type="application/x-ssp-definition" source="{after}"/>'
            for k in range(width)
        )
        files[f"{i}.ssd"] = (
            f'<ssd:SystemStructureDescription xmlns:ssd="{space}" name="n" version="1.0">'
            f'<ssd:System name="s"><ssd:Elements>{parts}</ssd:Elements></ssd:System>'
            "</ssd:SystemStructureDescription>"
        ).encode()
    files[f"{depth}.ssd"] = draw.choice((files["0.ssd"], files[STRUCTURE], b"<a/>"))
    inner = b'<ssd:Component name="inner" type="application/x-ssp-definition" source="0.ssd"/>'
    end = b"</ssd:Elements>"
    if draw.random() < 0.3:  # a package in a package, again and again
        files["in.ssp"] = zipped(files)
        inner = b"".join(
            b'<ssd:Component name="p%d" type="application/x-ssp-package" source="in.ssp"/>' % k
            for k in range(width)
        )
    return files | {STRUCTURE: files[STRUCTURE].replace(end, inner + end, 1)}


def changed(kind: str, content: bytes, draw: random.Random) -> bytes:
    if kind == "bytes":
        return mutations.flipped(content, draw)
    files = entries(content)
    if kind == "nested":
        files = nested(files, draw)
    elif kind == "description":
        name = draw.choice([name for name in files if name.endswith(".fmu")])
        inside = entries(files[name])
        change = draw.choice((text, elements))
        inside[DESCRIPTION] = change(inside[DESCRIPTION], draw)
        files[name] = zipped(inside)
    else:
        files[STRUCTURE] = CHANGES[kind](files[STRUCTURE], draw)
    return zipped(files)


def attack(number: int, seed: int) -> Iterator[Made]:
    draw = random.Random(seed)
    with own_folder() as folder:
        whole = [
            hl.export(name, {"duration": 0.05}, out=folder / f"{name}.ssp").read_bytes()
            for name in SCENES
        ]
        place, path = Place(folder), folder / "attack.ssp"
        for i in range(number):
            kind, which = KINDS[i % len(KINDS)], draw.randrange(len(SCENES))
            path.write_bytes(changed(kind, whole[which], draw))
            made = place.made(["run", str(path), "--out", str(place.out)])
            yield Made(kind, f"{SCENES[which]}, case {i}", *made)
