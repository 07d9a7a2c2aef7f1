"""Malformed FMUs and SSPs are refused with a reason and write no file."""

import os
import stat
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from fmpy import platform, sharedLibraryExtension

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.archive import open_archive, read_xml
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.ssp import read
from tests.little_fmus import description3
from tests.orchestrator.c_fmus import hostile_description
from tests.orchestrator.ssp.ssps import HEAD, UNTIMED, component

DESCRIPTION = hostile_description("2")

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]><fmiModelDescription fmiVersion="2.0">&c;
</fmiModelDescription>"""


def archive(path: Path, **entries: str | bytes) -> Path:
    with zipfile.ZipFile(path, "w") as made:
        for name, content in entries.items():
            made.writestr(name, content)
    return path


def fmu(path: Path, text: str = DESCRIPTION, **entries: str) -> Path:
    return archive(path, **{"modelDescription.xml": text, **entries})


def link(path: Path) -> Path:
    with zipfile.ZipFile(path, "w") as made:
        entry = zipfile.ZipInfo("resources/passwords")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        made.writestr(entry, "/etc/passwd")
    return path


def piped(path: Path) -> Path:
    os.mkfifo(path)
    return path


def flipped(path: Path) -> Path:
    content = bytearray(fmu(path).read_bytes())
    content[content.index(b"<CoSimulation")] ^= 1
    path.write_bytes(content)
    return path


HUGE = description3("huge", """<Float64 name="x" valueReference="1" causality="output">
<Dimension start="100000000000"/></Float64>""", ())  # fmt: skip
"""A kilobyte of XML that declares more entries than memory holds."""


def changed(old: str, new: str) -> Callable[[Path], Path]:
    assert old in DESCRIPTION
    return lambda path: fmu(path, DESCRIPTION.replace(old, new))


UNIT = """<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="{}"/></Unit>
</UnitDefinitions>"""
OUTSIDE = ["/tmp/x", "../x", "a/b", "a\\b", ""]
NO_LINES = ["a&#10;b", "a&#13;", "a&#9;b", "a&#x202e;b"]
REFERENCES = [2**32, 2**32 + 1, -1, 2**64]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: p, "there is no such file"),
        (piped, "not a regular file"),
        (lambda p: p.write_text("no zip") and p, "damaged, not a readable zip archive"),
        (lambda p: fmu(p).write_bytes(fmu(p).read_bytes()[:-30]) and p, "damaged"),
        (flipped, "damaged"),
        (lambda p: archive(p, readme="none"), "holds no modelDescription.xml"),
        (lambda p: fmu(p, **{f"resources/{i}": "" for i in range(10_000)}),
         "10001 entries; at most 10000 are unpacked; take out"),
        (lambda p: fmu(p, HUGE), "100000000000 numbers with .*; at most 1000000"),
        (lambda p: fmu(p, "<fmiModelDescription>"), "not well-formed XML"),
        (lambda p: fmu(p, LAUGHS), "declares a document type"),
        (lambda p: fmu(p, LAUGHS.encode("utf-16").decode("latin1")), "not well-formed|document"),
        (lambda p: fmu(p, **{"../evil.so": "x"}), "'../evil.so' points outside the archive"),
        (lambda p: fmu(p, **{"a/../../evil": "x"}), "points outside the archive"),
        (lambda p: fmu(p, **{"/etc/evil": "x"}), "points outside the archive"),
        (lambda p: fmu(p, **{"C:/evil": "x"}), "not a path with forward slashes"),
        (lambda p: fmu(p, **{"a/C:evil": "x"}), "not a path with forward slashes"),
        (lambda p: fmu(p, **{"..\\evil": "x"}), "points outside the archive; take no FMU from"),
        (lambda p: fmu(p, **{"binaries\\win64\\a.dll": "x"}),
         "has a backslash, where a zip archive has forward slashes; pack the FMU again"),
        (link, "is a symbolic link"),
        (lambda p: fmu(p), "no binary for this platform .* only for none"),
        (lambda p: fmu(p, **{"binaries/win95/hostile.dll": "x"}), "only for win95"),
        (lambda p: fmu(p, **{f"binaries/{platform}/other{sharedLibraryExtension}": "x"}),
         r"is 'hostile', and binaries/\w+ has other\.\w+, not hostile\.\w+: rename"),
        (changed('"2.0"', '"1.0"'), "it is of FMI 1.0: an FMU of FMI 2.0 or 3.0 for"),
        (changed('"2.0"', '"3.0-beta.2"'), "of FMI 3.0-beta.2, a draft of the standard"),
        (changed("CoSimulation ", "Simulation "), "without <CoSimulation> or <ModelExchange>: an"),
        (changed('index="2"', 'index="9"'), "Outputs of index 9, where there are from 1 to"),
        (changed('index="2"', 'index="0"'), "Outputs of index 0, where there are from 1 to"),
        (changed('<Unknown index="2"/>', '<Unknown index="2"/>' * 2), "index 2 stands twice"),
        (changed('index="2"', 'index="2" dependencies="0"'), "index 2 depends on 0, where"),
        *((changed("<ModelVariables>", UNIT.format(factor) + "<ModelVariables>"), "unit 'mm' has f")
          for factor in ("0", "-0.0", "INF", "NaN", "1e-400")),
        (changed('start="0"', 'start="zero"'), "cannot be used"),
        *((changed('r="hostile"', f'r="{name}"'), "is no name of a library") for name in OUTSIDE),
        *((changed('name="y"', f'name="{name}"'), "printable characters") for name in NO_LINES),
        *((changed('Reference="1"', f'Reference="{number}"'),
           f"'y': value reference {number} is not from 0 to") for number in REFERENCES),
        # They would be one column, and all columns after it those of their neighbours.
        (changed('name="u"', 'name="y"'), "'y': 2 variables have this name"),
    ],
)  # fmt: skip
def test_malformed_fmus(tmp_path, make, message):
    path = make(tmp_path / "model.fmu")
    with pytest.raises(InputFault, match=message) as refused:
        describe(path)
    assert str(path) in str(refused.value)
    assert {p.name for p in tmp_path.iterdir()} <= {"model.fmu"}


def test_xml_of_any_size_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr("hapticlink.orchestrator.fmi.archive.MAX_XML_BYTES", 100)
    path = fmu(tmp_path / "model.fmu")
    with (
        open_archive(path, "FMU") as found,
        pytest.raises(InputFault, match="at most 100 are read"),
    ):
        read_xml(found, "modelDescription.xml")


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    """A gigabyte of zeros in a megabyte."""
    path = fmu(tmp_path / "model.fmu")
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as made,
        made.open("resources/zeros", "w", force_zip64=True) as entry,
    ):
        for _ in range(33):
            entry.write(bytes(2**25))
    with pytest.raises(InputFault, match=r"it has \d+ bytes unpacked; at most 1073741824 are"):
        describe(path)


ONE = f"<ssd:Elements>{component('a', 'a')}</ssd:Elements>"
SSD = f'{HEAD}<ssd:System name="top">{ONE}</ssd:System>{UNTIMED}'


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: p, "there is no such file"),
        (lambda p: p.write_text("no zip") and p, "damaged"),
        (lambda p: archive(p, other="x"), "holds no SystemStructure.ssd"),
        (lambda p: archive(p, **{"SystemStructure.ssd": LAUGHS}), "declares a document type"),
        (lambda p: archive(p, **{"SystemStructure.ssd": "<a/>"}), "is no SSP 1.0"),
        (lambda p: archive(p, **{"SystemStructure.ssd": SSD}), "there is no 'resources/a.fmu'"),
        (lambda p: archive(p, **{"SystemStructure.ssd": SSD, "../a": "x"}), "points outside"),
        (lambda p: archive(p, **{"SystemStructure.ssd": SSD, "resources/a.fmu": "x"}),
         "a.fmu: damaged"),
        (lambda p: archive(p, **{"SystemStructure.ssd": SSD.replace("resources", "../etc")}),
         "there is no '../etc/a.fmu'"),
    ],
)  # fmt: skip
def test_malformed_ssps(tmp_path, make, message):
    path = make(tmp_path / "system.ssp")
    with pytest.raises(InputFault, match=message):
        read.tables(path)
    assert {p.name for p in tmp_path.iterdir()} <= {"system.ssp"}


TWO = """<Float64 name="u" valueReference="1" causality="input" start="0"/>
<Float64 name="y" valueReference="7" causality="output"/>"""
OUTPUT = '<Output valueReference="7"'


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('<InitialUnknown valueReference="7" dependencies="1"/>', "no binary for this platform"),
        ('<InitialUnknown valueReference="2"/>', "InitialUnknown of valueReference 2, where"),
        ('<Output valueReference="7"/>', "Output of valueReference 7 stands twice"),
        ('<InitialUnknown valueReference="7" dependencies="0"/>', "7 depends on 0, where"),
    ],
)
def test_the_structure_of_fmi_3_names_its_variables(tmp_path, more, message):
    text = description3("two", TWO, (7,)).replace("</ModelStructure>", f"{more}</ModelStructure>")
    with pytest.raises(InputFault, match=message):
        describe(fmu(tmp_path / "model.fmu", text))


def test_a_clock_before_1980_reads_fmus(tmp_path, monkeypatch):
    """A zip file holds no date before that, and ours, of a description, needs none of today."""
    path = fmu(tmp_path / "model.fmu")
    epoch = time.gmtime(0)
    monkeypatch.setattr(time, "localtime", lambda *_: epoch)
    with pytest.raises(InputFault, match="no binary for this platform"):
        describe(path)
