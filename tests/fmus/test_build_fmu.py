"""The FMU as a file: the same bytes, whole or not at all, valid, documented."""

import re
import struct
import subprocess
import sys
import uuid
import zipfile
import zlib
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import casadi as ca
import fmpy
import pytest
from fmpy.validation import validate_fmu

from hapticlink.components.component import Block, Variable
from hapticlink.fmus.blocks import build_block
from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.fmus.errors import FmuError, UnsupportedPlatform
from hapticlink.fmus.python_fmu_entries import entries
from hapticlink.fmus.write_fmu import findings, write_fmu
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.blocks import blocks
from tests.fmus import sample_components


def test_same_bytes_from_another_process(fmus, tmp_path):
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import sample_components\nfrom hapticlink.fmus.build_fmu import build\n"
        "build(sample_components.spring(), sys.argv[2])"
    )
    here = str(Path(__file__).parent)
    subprocess.run([sys.executable, "-c", code, here, str(tmp_path)], check=True)
    assert (tmp_path / "spring.fmu").read_bytes() == fmus["spring"].read_bytes()


def test_the_guid_is_of_the_content(fmus, tmp_path):
    def guid(path):
        return fmpy.read_model_description(str(path)).guid

    own = guid(fmus["spring"])
    uuid.UUID(own)
    assert re.fullmatch(r"\{[0-9a-f-]{36}\}", own)
    changed = replace(sample_components.spring(), description="another word")
    assert guid(build(changed, tmp_path)) != own
    assert guid(build(sample_components.spring(substeps=2), tmp_path)) != own
    assert guid(build(sample_components.spring(), tmp_path, step_size=0.1)) != own


def test_binaries_of_both_platforms(fmus):
    names = zipfile.ZipFile(fmus["spring"]).namelist()
    assert {n for n in names if n.startswith("binaries/")} == {
        "binaries/linux64/spring.so",
        "binaries/win64/spring.dll",
    }
    assert names == sorted(names)


def test_a_finding_publishes_nothing(tmp_path):
    build(sample_components.spring(), tmp_path)
    before = (tmp_path / "spring.fmu").read_bytes()
    block = Block(parameters=[Variable("no name")])
    odd = block.component("spring", "", "continuous", initial={}, step={}, output={})
    with pytest.raises(FmuError, match=r'"no name".* is not a legal variable name'):
        build(odd, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["spring.fmu"]
    assert (tmp_path / "spring.fmu").read_bytes() == before


@pytest.mark.parametrize("machine", ["aarch64", "arm64"])
def test_a_processor_without_a_binary_is_named(tmp_path, monkeypatch, machine):
    monkeypatch.setattr("platform.machine", lambda: machine)
    with pytest.raises(UnsupportedPlatform, match=machine):
        build(sample_components.spring(), tmp_path)


SPRING = sample_components.spring()
X = ca.SX.sym("x", 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "two words"}, "two words"),
        ({"substeps": 0}, "0 substeps"),
        ({"inputs": (Variable("F", (2,)),)}, "does not fit the declared variables"),
        ({"initialize": ca.Function("start", [X], [X])}, "a function named start"),
        ({"outputs": (Variable("F"), Variable("x", (3,)))}, "declared twice: F"),
        ({"inputs": (Variable("F", unit="lbf"),)}, "'lbf' is none of"),
    ],
)
def test_what_cannot_be_built_says_why(tmp_path, changes, message):
    with pytest.raises(FmuError, match=message):
        build(replace(SPRING, **changes), tmp_path)
    assert list(tmp_path.iterdir()) == []


class _Text(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.text: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def test_documentation_names_every_variable_and_escapes(fmus):
    page = zipfile.ZipFile(fmus["spring"]).read("documentation/index.html").decode()
    parser = _Text()
    parser.feed(page)
    assert parser.open == []
    assert "  v <- v + h a < 1" in parser.text
    cells = [text.strip() for text in parser.text]
    for word in ("F", "pushing force", "m", "before the run", "8.0", "m, m/s", "m/s2"):
        assert word in cells


@pytest.mark.parametrize("name", ["spring", "controller"])
def test_the_icon_is_a_whole_png(fmus, name):
    data = zipfile.ZipFile(fmus[name]).read("model.png")
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    at, kinds, pixels = 8, [], b""
    while at < len(data):
        (size,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        (crc,) = struct.unpack(">I", data[at + 8 + size : at + 12 + size])
        assert crc == zlib.crc32(kind + body)
        kinds.append(kind)
        pixels += body if kind == b"IDAT" else b""
        at += 12 + size
    assert kinds == [b"IHDR", b"IDAT", b"IEND"]
    assert len(zlib.decompress(pixels)) == 96 * (1 + 3 * 96)


def test_the_icon_tells_the_kind(fmus):
    names = ("spring", "fragile", "controller", "gain")
    read = {name: zipfile.ZipFile(fmus[name]).read("model.png") for name in names}
    assert read["spring"] == read["fragile"] != read["controller"] == read["gain"]


@pytest.mark.parametrize("block", ["virtual_mechanism", "virtual_environment"])
def test_documentation_names_no_file_of_the_sources(block, tmp_path):
    plan = next(b for b in blocks(open_scene.load("closed-loop-ideal")).loop if b.name == block)
    path = build_block(plan.block, plan.settings, tmp_path)
    page = zipfile.ZipFile(path).read("documentation/index.html").decode()
    assert not re.search(r"\w\.py\b|`\w+_\w+`", page)


DESCRIPTION = "modelDescription.xml"
VALID = ("x", "_a1", "x[1]", "a.b[2,3].c", "der(x)", "'a b'")
INVALID = ("1x", "x[]", "a..b", "x y", "é", "x[a]")


def renamed(name: str) -> dict[str, bytes]:
    """The entries of an FMU, one of whose variables has the name."""
    files = entries(sample_components.stateless(), stop_time=1.0, step_size=0.1)
    text = files[DESCRIPTION].decode()
    assert text.count('name="y"') == 1
    return {**files, DESCRIPTION: text.replace('name="y"', f'name="{name}"').encode()}


@pytest.mark.parametrize("name", VALID)
def test_a_valid_name_is_written(name: str, tmp_path: Path) -> None:
    path = write_fmu(renamed(name), tmp_path, "gain")
    assert validate_fmu(str(path)) == findings(str(path)) == []


@pytest.mark.parametrize("name", INVALID)
def test_another_name_is_refused_by_fmpy(name: str, tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=r"(?s)`gain` fails validation.*is not a legal"):
        write_fmu(renamed(name), tmp_path, "gain")
    assert not [*tmp_path.iterdir()]


def test_fmus_have_the_licenses_of_what_they_contain(tmp_path):
    """pythonfmu's asks to be in all copies; native FMUs have none."""
    for made, names in (
        (build(sample_components.stateless(), tmp_path / "python"), ["hapticlink", "pythonfmu"]),
        (build_native(sample_components.stateless(), tmp_path / "native"), ["hapticlink"]),
    ):
        with zipfile.ZipFile(made) as archive:
            text = archive.read("documentation/licenses/license.txt").decode()
        assert re.findall(r"^(\w+)\n-+$", text, re.M) == names
        assert text.count("Permission is hereby granted") == len(names)
