"""What is special about native FMUs: the binary, its compiler, and the bits of the Python FMU."""

from __future__ import annotations

import ctypes
import os
import shutil
import struct
import subprocess
import sys
import threading
import zipfile
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy import fmi2, sharedLibraryExtension
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.blocks.controller import controller
from hapticlink.components.blocks.hand import hand
from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.component import Component
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.drives import PDDrive
from hapticlink.components.specs.hand import ArmHand
from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Limits,
    Linkage,
    Mechanism,
    OperationalPoint,
)
from hapticlink.components.specs.paths import CoordinateSine, Interpolation
from hapticlink.fmus.blocks import component
from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.fmus.check import check_fmu, initialize, session
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.licenses import ENTRY
from hapticlink.fmus.native import compile_library, compiler, split_functions
from hapticlink.fmus.native.compiler import linker_cache
from hapticlink.fmus.native.source import component_source
from hapticlink.fmus.reproducible_zip import write_zip
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import blocks
from tests.fmus import sample_components
from tests.fmus.named_fmu import Named
from tests.mechanisms import one_body

OPTIONS = ("sensing=encoders", "controller.bias=full", "mechanism.directions=true")
NAMES = ("hand", "controller", "haptic_device", "virtual_mechanism", "virtual_environment")
H = 1 / 512
ERROR = 3


class Both(dict[str, tuple[Path, ...]]):
    """By name, each block of the report's experiment, and some more, as a Python and as a native
    FMU; two also as native ones of FMI 3.0, in which nothing but the arrays of variables is of the
    block. Each is built where it is first asked for."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder
        loaded = open_scene.load("closed-loop-ideal", OPTIONS)
        self._blocks = {b.name: (b.block, b.settings) for b in blocks.blocks(loaded).built}
        self._blocks["discrete_equivalent"] = ("discrete_equivalent", {"rule": "trapezoidal"})

    def __missing__(self, name: str) -> tuple[Path, ...]:
        made = OTHERS[name]() if name in OTHERS else component(*self._blocks[name])
        room = self._folder / name  # several are named virtual_mechanism
        three = name in ("controller", "virtual_mechanism")
        self[name] = (
            build(made, room / "python"),
            build_native(made, room / "native"),
            *((build_native(made, room / "native3", fmi=3),) if three else ()),
        )
        return self[name]


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> Both:
    return Both(tmp_path_factory.mktemp("both"))


SINE = CoordinateSine(mean=0.1, amplitude=0.2, frequency=3.0, phase=0.3)


def arm(
    rows: int,
    interpolation: Interpolation = "linear",
    timing: Literal["sampled", "continuous"] = "sampled",
) -> Component:
    """An arm on a path through so many rows, 300 of them within the run of `driven`."""
    draw = np.random.default_rng(2)
    path = np.column_stack([np.cumsum(draw.uniform(1e-5, 2e-4, rows)), draw.normal(size=(rows, 3))])
    target = tuple(map(tuple, path.tolist()))
    return hand(ArmHand(target=target, interpolation=interpolation, timing=timing))


def driven_slider(sine: CoordinateSine | None = None) -> Component:
    """A joint on a path whose rows stand within steps, at their ends and at the end of the run."""
    table = sine or ((0.005, 0.1), (8 * H, 0.3), (0.03, 0.2), (40 * H, 0.1))
    drive = PDDrive(table=table, stiffness=400.0, damping=8.0)
    linkage = one_body(Body(name="block", mass=2.0, inertia=1.0), type="prismatic", drive=drive)
    return virtual_mechanism(linkage, Mechanism(integrator="linearly-implicit"), step_s=H)


def rubbing_rod() -> Component:
    """A rod that falls on a free disc on a floor, with friction there and in its pivot, and that
    turns back at a limit: states beside q and qd."""
    limits = Limits(upper=0.05, stiffness=50.0, restitution=0.6)
    pivot = Joint(name="pivot", child="rod", friction=0.02, friction_speed=0.05, limits=limits)
    rod = Body(
        name="rod", mass=0.2, inertia=1e-3, center=(0.1, 0.0), radius=0.01,
        capsule=((0.0, 0.0), (0.2, 0.0)),
    )  # fmt: skip
    linkage = Linkage(
        body=(rod, Body(name="disc", mass=0.1, radius=0.008)),
        joint=(pivot, Joint(name="disc", type="free", child="disc")),
        operational_point=OperationalPoint(body="rod", at=(0.2, 0.0)),
        start={"disc": (0.12, -0.02, 0.0)},
        start_velocity={"pivot": 3.0},
        gravity=(0.0, -9.81),
    )
    floor = ((-1.0, -0.03), (1.0, -0.03), (0.0, 1.5))
    contacts = Contacts(enclosure=floor, friction=0.3, detection="haptics", stiffness=2000.0)
    return virtual_mechanism(linkage, Mechanism(), None, contacts, step_s=H)


OTHERS: dict[str, Callable[[], Component]] = {
    "arm": lambda: arm(300),
    "driven": driven_slider,
    "rubbing": rubbing_rod,
    "passive": lambda: controller(Controller(passivity=True), PLANE, 0.04),
    "splined": lambda: arm(300, "spline", "continuous"),
    "swung": lambda: driven_slider(SINE),
}


def driven(path: Path) -> np.ndarray:
    """All reals after each of 60 steps under changing inputs, the last 20 from a saved state."""
    rows = []
    with session(path) as at:
        slave = at.instance()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        rows.append(slave.getReal(at.reals))
        slave.exitInitializationMode()
        references = [v.valueReference for v in at.inputs]
        starts = np.array([float(v.start) for v in at.inputs])
        draw = np.random.default_rng(1)

        def steps(first: int, last: int) -> None:
            for k in range(first, last):
                if references:
                    slave.setReal(references, starts + 0.01 * draw.standard_normal(len(starts)))
                slave.doStep(k * H, H)
                rows.append(slave.getReal(at.reals))

        steps(0, 20)
        state = slave.getFMUState()
        steps(20, 40)
        slave.setFMUState(state)
        slave.freeFMUState(state)
        rows.append(slave.getReal(at.reals))
        steps(20, 40)
    return np.array(rows)


@pytest.mark.parametrize(
    "name",
    [*NAMES, "discrete_equivalent", "arm", "driven", "rubbing", "splined", "swung", "passive"],
)
def test_every_block_gives_the_bits_of_its_python_fmu(both, name):
    by_python, *by_c = map(driven, both[name])
    assert np.isfinite(by_python).all()
    for found in by_c:
        np.testing.assert_array_equal(found, by_python)


def test_deflections_are_part_of_a_saved_state(both):
    """After 30 steps, in which the rod turned at its limit and fell: 20 more, twice."""
    for path in both["rubbing"]:
        with session(path) as at:
            slave = at.instance()
            initialize(slave)
            for k in range(30):
                slave.doStep(k * H, H)
            state, twice = slave.getFMUState(), []
            for _ in range(2):
                slave.setFMUState(state)
                rows = []
                for k in range(30, 50):
                    slave.doStep(k * H, H)
                    rows.append(slave.getReal(at.reals))
                twice.append(rows)
            slave.freeFMUState(state)
            np.testing.assert_array_equal(*twice)


@pytest.mark.parametrize("name", [*NAMES, "driven", "rubbing"])
def test_contract_of_the_blocks(both, name):
    for path in both[name]:
        assert check_fmu(path) == []


@pytest.mark.parametrize("name", [*NAMES, "arm", "driven", "rubbing", "splined", "swung"])
def test_plain_python_gives_the_same_bits(both, name, monkeypatch):
    by_c = driven(both[name][1])
    monkeypatch.setenv("HAPTICLINK_PURE_PYTHON", "1")
    np.testing.assert_array_equal(by_c, driven(both[name][0]))


@pytest.mark.parametrize("name", ["arm", "driven"])
def test_pieces_of_long_functions_give_the_same_bits(both, name, tmp_path, monkeypatch):
    """The arm calls look-ups; the statements of the slider are pieces in several files."""
    whole = both[name][0]
    for size, statements in (("MAX_STATEMENTS", 30), ("PIECE_STATEMENTS", 20), ("FILE_PIECES", 5)):
        monkeypatch.setattr(split_functions, size, statements)
    made = arm(300) if name == "arm" else driven_slider()
    header, files = component_source(made)
    assert header.count("noinline") > len([*files]) >= 1
    split = build_native(made, tmp_path)
    np.testing.assert_array_equal(driven(split), driven(whole))
    if shutil.which("cc"):
        np.testing.assert_array_equal(driven(rebuilt(split, tmp_path / "cc", by_cc)), driven(split))


def rebuilt(path: Path, room: Path, build: Callable[[Path], object]) -> Path:
    """The FMU with the library that `build` makes of its unpacked files."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(room)
    for library in room.glob("binaries/*/*"):
        library.unlink()
    build(room)
    made = {str(f.relative_to(room)): f.read_bytes() for f in room.rglob("*") if f.is_file()}
    target = room.with_suffix(".fmu")
    with target.open("wb") as file:
        write_zip(made, file)
    return target


def by_cc(room: Path) -> None:
    description = ET.parse(room / "modelDescription.xml")
    listed = description.findall("CoSimulation/SourceFiles/File")
    sources = [room / "sources" / file.attrib["name"] for file in listed]
    assert {*sources} == {*room.glob("sources/*.c")}
    (folder,) = room.glob("binaries/*")
    library = folder / (description.getroot().attrib["modelName"] + sharedLibraryExtension)
    command = ["cc", "-shared", "-fPIC", "-std=gnu11", "-O1", "-ffp-contract=off", "-w"]
    subprocess.run([*command, "-o", library, *sources, "-lm"], check=True)


@pytest.mark.skipif(not (shutil.which("cmake") and shutil.which("make")), reason="no cmake or make")
@pytest.mark.parametrize("which", [1, 2])
def test_fmpy_rebuilds_a_block(both, tmp_path, which):
    path = both["controller"][which]
    (tmp_path / "build").mkdir()
    again = rebuilt(
        path, tmp_path / "own", lambda room: build_platform_binary(room, tmp_path / "build")
    )
    np.testing.assert_array_equal(driven(again), driven(path))


def test_libraries_for_fmi3_are_in_a_folder_for_each_processor(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_compile", lambda *given: given[2])
    assert dict(compiler.binaries([], "one", tmp_path, compiler.PLATFORMS_3, ())) == {
        "binaries/x86_64-linux/one.so": "x86_64-linux-gnu.2.17",
        "binaries/aarch64-linux/one.so": "aarch64-linux-gnu.2.17",
        "binaries/x86_64-windows/one.dll": "x86_64-windows-gnu",
        "binaries/x86_64-darwin/one.dylib": "x86_64-macos.11.0",
        "binaries/aarch64-darwin/one.dylib": "aarch64-macos.11.0",
    }


def test_one_linker_at_a_time_uses_the_cache_of_its_target(tmp_path, monkeypatch):
    """Another target is linked beside it; a second one for the same target waits."""
    monkeypatch.delenv("ZIG_GLOBAL_CACHE_DIR", raising=False)
    monkeypatch.setattr("hapticlink.fmus.cache.user_folder", lambda: tmp_path)
    entered = []

    def link(target):
        with linker_cache(target) as cache:
            entered.append(cache["ZIG_GLOBAL_CACHE_DIR"])

    with linker_cache("here") as first, linker_cache("there") as other:
        assert first != other
        waiting = threading.Thread(target=link, args=("here",))
        waiting.start()
        waiting.join(0.3)
        assert entered == []
    waiting.join()
    assert entered == [first["ZIG_GLOBAL_CACHE_DIR"]]


def test_rows_of_a_table_are_data(both):
    """The C text has as many statements for a path of 3000 rows as for one of 300."""
    short, long = (component_source(arm(rows))[0] for rows in (300, 3000))
    assert len(long) > 5 * len(short)
    assert long.count(";") == short.count(";")


@pytest.mark.usefixtures("compiler_of_its_own")
def test_the_same_component_gives_the_same_bytes(native_fmus, tmp_path):
    again = build_native(sample_components.spring(), tmp_path)
    assert again.read_bytes() == native_fmus["spring"].read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_the_same_scene_gives_the_same_bytes(both, name, tmp_path):
    scene = open_scene.load("closed-loop-ideal", OPTIONS)
    block = next(b for b in blocks.blocks(scene).built if b.name == name)
    again = build(component(block.block, block.settings), tmp_path)
    assert again.read_bytes() == both[name][0].read_bytes()


def test_the_archive_is_self_contained(native_fmus, tmp_path):
    """No Python in it, and none needed: its library loads and names itself without."""
    with zipfile.ZipFile(native_fmus["spring"]) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    (library,) = (n for n in names if n.startswith("binaries/"))
    others = {n for n in names if not n.startswith("sources/")}
    assert others == {
        library,
        ENTRY,
        "documentation/index.html",
        "model.png",
        "modelDescription.xml",
    }
    assert b"python" not in (tmp_path / library).read_bytes().lower()
    description = (tmp_path / "modelDescription.xml").read_text()
    assert 'needsExecutionTool="false"' in description
    assert 'canBeInstantiatedOnlyOncePerProcess="false"' in description
    version = ctypes.CDLL(str(tmp_path / library)).fmi2GetVersion
    version.restype = ctypes.c_char_p
    assert version() == b"2.0"


def sections(elf: bytes) -> dict[str, tuple[int, bytes]]:
    """Name -> (size, content) of an ELF64 file's sections (System V gABI, chapter 4)."""
    (table,) = struct.unpack_from("<Q", elf, 0x28)
    size, count, names_at = struct.unpack_from("<HHH", elf, 0x3A)
    rows = [struct.unpack_from("<IIQQQQ", elf, table + size * i) for i in range(count)]
    names = elf[rows[names_at][4] :]
    return {
        names[row[0] : names.index(b"\0", row[0])].decode(): (row[5], elf[row[4] :][: row[5]])
        for row in rows
    }


@pytest.mark.skipif(sys.platform != "linux", reason="reads an ELF file")
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", ["virtual_mechanism", "controller"])
def test_nothing_is_exported_but_fmi_and_nothing_is_shared(both, name, fmi):
    """Every defined symbol is a function of FMI; no byte of the library can be written by one
    instance and read by another."""
    with zipfile.ZipFile(both[name][fmi - 1]) as archive:
        (library,) = (n for n in archive.namelist() if n.endswith(".so"))
        found = sections(archive.read(library))
    symbols, texts = found[".dynsym"][1], found[".dynstr"][1]
    exported = set()
    for at in range(24, len(symbols), 24):
        text, _, _, section = struct.unpack_from("<IBBH", symbols, at)
        if section:
            exported.add(texts[text : texts.index(b"\0", text)].decode())
    assert {f"fmi{fmi}DoStep", f"fmi{fmi}Reset"} <= exported
    assert [n for n in exported if not n.startswith(("fmi2", f"fmi{fmi}"))] == []
    assert found.get(".data", (0, b""))[0] == found.get(".bss", (0, b""))[0] == 0


def test_a_message_has_its_status_and_category(native_fmus):
    with session(native_fmus["fragile"]) as at:
        said = []
        slave = FMU2Slave(
            guid=at.description.guid,
            unzipDirectory=at.folder,
            modelIdentifier="fragile",
            instanceName="mine",
        )
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda _, *about: said.append(about))
        slave.instantiate(callbacks=callbacks)
        initialize(slave)
        slave.setReal([0], [100.0])
        with pytest.raises(FMICallException):
            slave.doStep(0.0, 0.1)
        slave.freeInstance()
    ((name, status, category, message),) = said
    assert (name, status, category) == (b"mine", 2, b"logStatusDiscard")
    assert message.startswith(b"r[2] became nan at t = 0.1; ")


def test_the_last_successful_time_after_a_discard(native_fmus):
    """FMI 2.0.5 section 4.2.2: fmi2GetRealStatus answers after fmi2Discard."""
    with session(native_fmus["fragile"]) as at:
        fmu = Named(at).start()
        fmu.step(0.0, 0.25)
        fmu.set(u=100.0)
        with pytest.raises(FMICallException):
            fmu.step(0.25, 0.25)
        time = ctypes.c_double()
        fmu.slave.fmi2GetRealStatus(fmu.slave.component, 2, ctypes.byref(time))
        assert time.value == 0.25


@pytest.mark.parametrize("call", ["getInteger", "getBoolean", "getReal"])
def test_an_unknown_reference_is_an_error_that_leaves_the_instance_whole(native_fmus, call):
    with session(native_fmus["spring"]) as at:
        fmu = Named(at).start()
        with pytest.raises(FMICallException) as raised:
            getattr(fmu.slave, call)([99])
        assert raised.value.status == 3
        assert fmu.get("a") == [-4.0]


def test_another_guid_is_refused_and_is_no_format(native_fmus):
    with session(native_fmus["spring"]) as at:
        at.description.guid = "{another %n}"
        with pytest.raises(Exception, match="Failed to instantiate"):
            at.instance()
        assert any("the guid {another %%n} is not that of this binary" in m for m in at.messages)
        at._instances.clear()


def test_null_pointers_are_refused(native_fmus):
    one = (ctypes.c_uint64 * 1)(0)
    with session(native_fmus["spring"]) as at:
        fmu = Named(at).start()
        own = ctypes.c_void_p(fmu.slave.component)
        for name, *arguments in (
            ("GetReal", own, None, 1, one),
            ("GetReal", own, one, 1, None),
            ("SetReal", own, None, 1, one),
            ("SetReal", own, one, 1, None),
            ("GetRealStatus", own, 2, None),
            ("GetFMUstate", own, None),
            ("SetFMUstate", own, None),
            ("SerializedFMUstateSize", own, None, one),
            ("DeSerializeFMUstate", own, None, 8, one),
            ("GetReal", None, one, 1, one),
            ("GetInteger", None, one, 0, one),
            ("GetFMUstate", None, one),
            ("CancelStep", None),
            ("ExitInitializationMode", None),
            ("Reset", None),
            ("Terminate", None),
        ):
            assert fmu.slave.dll[f"fmi2{name}"](*arguments) == ERROR, (name, arguments)
        assert fmu.slave.dll["fmi2GetReal"](own, None, 0, None) == 0
        assert "fmi2GetReal got a null pointer for 1 entries" in at.messages
        assert fmu.get("a") == [-4.0]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_instances_and_saved_states_are_freed(both):
    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    with session(both["virtual_mechanism"][1]) as at:

        def lives(count: int) -> None:
            for _ in range(count):
                slave = at.instance("x" * 20000)
                for _ in range(20):
                    state = slave.getFMUState()
                    slave.setFMUState(state)
                    slave.freeFMUState(state)
                at._instances.remove(slave)  # its library stays loaded for the next
                slave.fmi2FreeInstance(slave.component)

        lives(20)
        before = resident()
        lives(100)  # 2 MB of names, 2 MB of states
        assert resident() - before < 2**19


def universal_parts(data: bytes) -> list[tuple[int, bytes]]:
    (count,) = struct.unpack_from(">I", data, 4)
    rows = (struct.unpack_from(">IIIII", data, 8 + 20 * i) for i in range(count))
    return [(cpu, data[at : at + size]) for cpu, _, at, size, _ in rows]


def test_a_mac_binary_holds_both_processors(tmp_path):
    """Compiled from here; magic numbers and processor types of <mach-o/loader.h>."""
    path = build_native(sample_components.stateless(), tmp_path, platforms=("darwin64",))
    with zipfile.ZipFile(path) as archive:
        data = archive.read("binaries/darwin64/gain.dylib")
    assert data[:4] == bytes.fromhex("cafebabe")
    parts = universal_parts(data)
    assert [cpu for cpu, _ in parts] == [0x01000007, 0x0100000C]
    for cpu, part in parts:
        assert struct.unpack_from("<II", part) == (0xFEEDFACF, cpu)
        assert b"_fmi2DoStep" in part
        assert str(tmp_path.parent).encode() not in part


def test_a_windows_binary(tmp_path):
    path = build_native(sample_components.stateless(), tmp_path, platforms=("win64",))
    with zipfile.ZipFile(path) as archive:
        data = archive.read("binaries/win64/gain.dll")
    assert data[:2] == b"MZ"
    (header,) = struct.unpack_from("<I", data, 0x3C)
    assert data[header : header + 4] == b"PE\0\0"
    assert struct.unpack_from("<H", data, header + 4) == (0x8664,)
    assert b"fmi2DoStep\0" in data


def test_an_unknown_platform_is_named(tmp_path):
    with pytest.raises(FmuError, match="no platform 'amiga'; there are linux64, win64, darwin64"):
        build_native(sample_components.stateless(), tmp_path, platforms=("amiga",))


def test_another_version_of_ziglang_is_another_guid(tmp_path, native_fmus, monkeypatch):
    this = native_fmus["gain"]
    monkeypatch.setattr(compiler, "version", lambda name: "0.0")
    other = build_native(sample_components.stateless(), tmp_path)
    with session(this) as one, session(other) as two:
        assert one.description.guid != two.description.guid


@pytest.mark.usefixtures("compiler_of_its_own")
def test_c_that_does_not_compile_says_where(tmp_path):
    source = tmp_path / "broken.c"
    source.write_text("int broken(void) { return nothing; }\n")
    with pytest.raises(FmuError, match=r"broken\.c does not compile for .*\n.*broken\.c:1:27"):
        compile_library(source, tmp_path / "broken.so")
    assert list(tmp_path.iterdir()) == [source]


@pytest.mark.usefixtures("compiler_of_its_own")
def test_functions_that_the_system_lacks_come_from_zig_s_own_library(tmp_path, monkeypatch):
    """The second link is not carried out: zig would build that library for seconds."""
    zig, links = compiler._zig, []

    def no_own_library(arguments, folder, target):
        if "-c" not in arguments:
            links.append("-nostdlib" in arguments)
            if not links[-1]:
                return (folder / "library").write_bytes(b"linked")
        zig(arguments, folder, target)

    monkeypatch.setattr(compiler, "_zig", no_own_library)
    source = tmp_path / "divided.c"
    source.write_text("FMI2_Export __int128 divided(__int128 a, __int128 b) { return a / b; }\n")
    options = ["-include", "fmi2Functions.h"]
    library = compile_library(source, tmp_path / "divided.so", options=options)
    assert links == [True, False]
    assert library.read_bytes() == b"linked"


@pytest.mark.usefixtures("compiler_of_its_own")
def test_a_library_of_ones_own(tmp_path):
    source = tmp_path / "own.c"
    source.write_text(
        '#include "fmi2Functions.h"\n'
        "int hidden(void) { return VALUE; }\n"
        "FMI2_Export int shown(void) { return hidden() + 1; }\n"
    )
    library = compile_library(source, tmp_path / "own.so", options=["-DVALUE=41"])
    # In another process: a library stays loaded to the end of this one.
    code = (
        "import ctypes, sys; own = ctypes.CDLL(sys.argv[1]); "
        "print(own.shown(), hasattr(own, 'hidden'))"
    )
    command = [sys.executable, "-c", code, str(library)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["42", "False"]


@given(value=st.floats(), percent=st.booleans())
def test_start_values_and_names_stand_in_the_c_text(value, percent):
    """Every double comes back from its text, and a percent sign is no format."""
    from hapticlink.components.component import Block, Variable

    name = "load%" if percent else "load"
    b = Block(inputs=[Variable(name, (), "1", value)], outputs=[Variable("y")])
    made = b.component("c", "", "sampled", initial={}, step={}, output={"y": b.u[name]})
    text, _ = component_source(made)
    literal = text.split("starts[] = {")[1].split(",")[0]
    known = literal.replace("NAN", "nan").replace("INFINITY", "inf")
    assert array("d", [float(known)]).tobytes() == array("d", [value]).tobytes() or value != value
    assert ('"load%"' in text) is percent
