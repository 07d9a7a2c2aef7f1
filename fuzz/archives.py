"""FMUs that are damaged or made to harm: `hapticlink run` of a scene with such a file, beside the
results of an earlier run. Whatever is in the archive, the file is refused, or its fault is told, or
it runs; nothing is written elsewhere, and nothing of the earlier run is lost.
"""

from __future__ import annotations

import io
import random
import stat
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from fmpy import platform, sharedLibraryExtension

from fuzz import cases
from fuzz.commands import Place
from fuzz.processes import own_folder
from hapticlink.fmus.build_fmu import build
from tests.fmus import sample_components

Entries = Mapping[str, bytes]
SCENE = """title = "attack"
duration = 0.1
haptics.rate = 64
isolate = {isolate}
[[fmu]]
name = "one"
path = "model.fmu"
"""
XML = "modelDescription.xml"


class Maker:
    """Archives from the entries of a good FMU, by seed; `outside` is a folder that none of them may
    write to."""

    def __init__(self, entries: Entries, outside: Path, draw: random.Random) -> None:
        self.entries, self.outside, self.draw = entries, outside, draw

    def _binary(self) -> str:
        found = [n for n in self.entries if n.startswith(f"binaries/{platform}/")]
        return next(n for n in found if n.endswith(sharedLibraryExtension))

    def _name(self) -> str:
        return self.draw.choice([XML, XML, self._binary(), *self.entries])

    def flipped(self) -> bytes:
        content = bytearray(zipped(self.entries))
        for _ in range(self.draw.choice((1, 1, 2, 8, 100))):
            content[self._place(len(content))] ^= 1 << self.draw.randrange(8)
        return bytes(content)

    def _place(self, size: int) -> int:
        """Often at an end, where the directory and the first headers are."""
        at = self.draw.choice((self.draw.randrange(size), -1 - self.draw.randrange(500), 0))
        return at or self.draw.randrange(100)

    def cut(self) -> bytes:
        content = zipped(self.entries)
        first, last = sorted(self.draw.randrange(len(content)) for _ in range(2))
        kept = (content[:first], content[last:], content[:first] + content[last:], content * 2)
        return self.draw.choice(kept)

    def swapped(self) -> bytes:
        """Two entries exchanged, one gone, one empty, one twice: each with its right checksum."""
        changed, (a, b) = dict(self.entries), (self._name(), self._name())
        how = self.draw.randrange(4)
        if how == 0:
            changed[a], changed[b] = changed[b], changed[a]
        elif how == 1:
            del changed[a]
        elif how == 2:
            changed[a] = b""
        else:
            return zipped(changed, [(a, self.entries[b])])
        return zipped(changed)

    def xml(self) -> bytes:
        text = self.entries[XML]
        for _ in range(self.draw.choice((1, 1, 1, 3, 10))):
            text = self._changed(text)
        return zipped({**self.entries, XML: text})

    def _changed(self, text: bytes) -> bytes:
        """A value, a tag, a line or a byte of XML is another."""
        how = self.draw.randrange(5)
        quotes = [i for i, c in enumerate(text) if c == ord('"')]
        lines = text.splitlines(keepends=True)
        if how < 2 and len(quotes) > 1:
            i = self.draw.randrange(len(quotes) // 2) * 2
            return text[: quotes[i] + 1] + self.draw.choice(VALUES) + text[quotes[i + 1] :]
        if how == 2 and lines:
            i, j = self.draw.randrange(len(lines)), self.draw.randrange(len(lines))
            return b"".join(self.draw.choice((lines[:i] + lines[i + 1 :], lines[:i] + lines[j:])))
        if how == 3:
            tag = self.draw.choice((b"Real", b"Unknown", b"CoSimulation", b"ScalarVariable"))
            return text.replace(tag, self.draw.choice(TAGS), self.draw.choice((1, 2, -1)))
        at = self.draw.randrange(len(text) + 1)
        return text[:at] + bytes([self.draw.randrange(256)]) + text[at + 1 :]

    def binary(self) -> bytes:
        """Another platform's, a damaged one, or none."""
        name, content = self._binary(), self.entries[self._binary()]
        other = next(c for n, c in self.entries.items() if n.endswith(".dll"))
        at = self.draw.randrange(len(content))
        damaged = bytearray(content)
        for _ in range(self.draw.choice((1, 10, 1000))):
            damaged[self.draw.randrange(len(content))] = self.draw.randrange(256)
        found = self.draw.choice((other, content[:at], bytes(damaged), b"\x7fELF", bytes(10_000)))
        return zipped({**self.entries, name: found})

    def bomb(self) -> bytes:
        """More than there is room for, by number or by what headers say; and less than they say."""
        if self.draw.random() < 0.2:
            return zipped(self.entries, [(f"resources/{i}", b"") for i in range(11_000)])
        content = bytearray(zipped(self.entries, [("resources/zeros", bytes(2**22))]))
        says = self.draw.choice((1, 2**22 + 1, 2**31, 2**32 - 2)).to_bytes(4, "little")
        for mark, at in self.draw.choice((SIZES[:1], SIZES[1:], SIZES)):
            header = content.rfind(mark, 0, content.rfind(b"resources/zeros"))
            content[header + at : header + at + 4] = says
        return bytes(content)

    def name(self) -> bytes:
        """An entry whose name leads elsewhere, is none, or is in the way of another."""
        up = "../" * self.draw.randrange(1, 12)
        up_and_out = (f"{up}{self.outside}/evil", f"resources/{up}evil", f"{up}evil")
        long = "resources/" + "x" * self.draw.choice((255, 256, 5000))
        deep = "x/" * self.draw.choice((100, 2000)) + "y"
        odd = ("resources/\u00fc\u202e\n", "resources/con.txt ", "resources/evil\0/../../evil")
        windows = (f"..\\..\\{self.outside}\\evil", "C:/evil", "//server/share/evil")
        taken = ("resources", "binaries/", f"{XML}/evil")
        name = self.draw.choice(
            (f"{self.outside}/evil", *up_and_out, *windows, *taken, long, deep, *odd, ".", "")
        )
        info = zipfile.ZipInfo("x")
        info.filename = name
        info.external_attr = self.draw.choice((0o644, 0o000, 0o4777, *LINKS)) << 16
        target = str(self.outside).encode()
        further = [("resources/link/evil", b"evil")] if self.draw.random() < 0.2 else []
        return zipped(self.entries, [(info, self.draw.choice((b"evil", target))), *further])


SIZES = ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22))
"""Where the size of an entry stands, in the directory and before the entry."""
LINKS = (stat.S_IFLNK | 0o777, stat.S_IFIFO | 0o666, stat.S_IFDIR | 0o755)
VALUES = (
    b"", b"-1", b"4294967296", b"1e999", b"NaN", b"true", b"x" * 100_000, b"../../evil", b"/evil",
    b"%s%n", b"\xff", b"&#x1b;", b"&#155;", b"&lt;", b"2.0", b"3.0", b"input", b"output",
    b"parameter", b"fixed", b"0", b"1", b"99999999999999999999", b"a\nb", b"x[1]", b"x[1,2,3]",
)  # fmt: skip
TAGS = (b"Integer", b"String", b"Boolean", b"Enumeration", b"ModelExchange", b"Float64", b"Unit")
KINDS: dict[str, tuple[Callable[[Maker], bytes], bool]] = {
    "bytes flipped": (Maker.flipped, False),
    "cut": (Maker.cut, False),
    "entries exchanged": (Maker.swapped, False),
    "XML changed": (Maker.xml, False),
    "binary damaged, isolated": (Maker.binary, True),
    "bombs": (Maker.bomb, False),
    "names": (Maker.name, False),
}
"""How an archive is made, and whether the FMU gets a process of its own: a damaged binary whose
checksum is right is code that anything may come of."""


def entries(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(entries: Entries, further: Sequence[tuple[str | zipfile.ZipInfo, bytes]] = ()) -> bytes:
    """`further` come after the entries, under names that may be there already or be no names."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a name that is there already
        for name, content in entries.items():
            archive.writestr(name, content)
        for name, content in further:
            archive.writestr(name, content, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def attack(number: int, seed: int) -> Iterator[cases.Made]:
    """`number` archives, the kinds in turn."""
    with own_folder() as folder:
        (folder / "cases").mkdir()
        place, outside = Place(folder / "cases"), folder / "outside"
        outside.mkdir()
        good = entries(build(sample_components.spring(), folder).read_bytes())
        scene = folder / "scene.toml"
        for i, case, draw in cases.seeded(number, seed):
            kind = [*KINDS][i % len(KINDS)]
            make, isolate = KINDS[kind]
            maker = Maker(good, outside, draw)
            (folder / "model.fmu").write_bytes(make(maker))
            scene.write_text(SCENE.format(isolate=str(isolate).lower()))
            there = _there(folder)
            outcome, wrong = place.made(["run", str(scene), "--out", str(place.out)])
            if escaped := _there(folder) - there:
                outcome, wrong = "lost", f"written: {', '.join(sorted(escaped))}"
            yield cases.Made(kind, case, outcome, wrong)


def _there(folder: Path) -> set[str]:
    """What stands in the folder, but for the place of the cases, which looks after its own."""
    found = (path.relative_to(folder) for path in folder.rglob("*"))
    return {str(path) for path in found if path.parts[0] != "cases"}
