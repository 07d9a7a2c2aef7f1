"""Small systems for tests: real FMUs built from components whose signals carry their stamps."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import cache
from hashlib import sha256
from pathlib import Path

import casadi as ca
import pytest

import hapticlink as hl
from hapticlink.commands import main
from hapticlink.components import registry
from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus import lock
from hapticlink.fmus.build_fmu import build
from hapticlink.fmus.native import compiler
from hapticlink.orchestrator.base import shelf
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.scene.overrides import Options, write_options
from hapticlink.orchestrator.system.system import Coupling, Fmu, System
from tests.orchestrator.systems import connected


@pytest.fixture(autouse=True)
def own_temporary_folder(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """Where temporary folders land, so that what a test leaves behind is its own."""
    folder = tmp_path_factory.mktemp("temporary")
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


@pytest.fixture
def emptied_temporary_folder(own_temporary_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """That folder, for a test that looks at what its runs leave there: no FMU stays unpacked."""
    process_cache.trim(0)
    monkeypatch.setattr(shelf, "_keeping", 0)
    return own_temporary_folder


COMPILED = compiler._compile


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all processes of these tests have. Pytest removes it with the others of a
    session, that of a session that was killed, too: but for the last three."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    (shared / "compiled").mkdir(exist_ok=True)
    return shared / "compiled"


def made_once(path: Path, make: Callable[[Path], object]) -> Path:
    """A file of that folder, made by whichever process needs it first."""
    with lock.hold_lock(path.with_name(f"{path.name}.lock"), lambda: None):
        if not path.exists():
            make(part := path.with_name(f"{path.name}.part"))
            part.replace(path)
    return path


@pytest.fixture(scope="session", autouse=True)
def compiled_once(shared_folder: Path) -> Iterator[None]:
    """The same C text for the same system is compiled once; fmus/test_native_fmu_entries.py has
    tests of the compiler itself."""

    def compiled(
        source: Iterable[Path], folder: Path, target: str, options: Sequence[str]
    ) -> bytes:
        files = [Path(file).resolve() for file in source]
        included = {Path(option[2:]) for option in options if option.startswith("-I")}
        headers = {h for room in {f.parent for f in files} | included for h in room.rglob("*.[ch]")}
        texts = [path.read_bytes() for path in (*files, *sorted(headers))]
        flags = [target, *(option for option in options if not option.startswith("-I"))]
        key = sha256(b"\0".join([*texts, *map(str.encode, flags)])).hexdigest()
        made = made_once(
            shared_folder / key,
            lambda part: part.write_bytes(COMPILED(files, folder, target, options)),
        )
        return made.read_bytes()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiler, "_compile", compiled)
        yield


@pytest.fixture
def compiler_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing that another test has compiled is taken in the place of what this one compiles."""
    monkeypatch.setattr(compiler, "_compile", COMPILED)


RUNNING = (
    *("tests/analysis/", "tests/api/", "tests/commands/", "tests/components/", "tests/docs/"),
    *("tests/programs/", "tests/reference/", "tests/sentences/", "tests/studies/"),
    *(f"tests/orchestrator/{room}/" for room in ("holds", "plan", "results", "run", "scene")),
    *("tests/orchestrator/ssp/", "tests/orchestrator/system/", "tests/visualization/"),
)
"""Rooms of tests that run scenes for their numbers."""


@pytest.fixture(scope="session")
def keeping() -> Iterator[ExitStack]:
    with ExitStack() as kept:
        yield kept


@pytest.fixture(scope="module", autouse=True)
def fmus_unpacked_once(request: pytest.FixtureRequest, keeping: ExitStack) -> None:
    """Loading its FMUs is half of a short run: as in a sweep, those of one module of tests stay
    unpacked for the next. Runs do not, nor do parts that it has registered, with which no run is
    kept."""
    for each in shelf._shelves:
        each.clear()
    for parts in registry._REGISTRIES:
        for name in [*parts.origins]:
            del parts[name], parts.origins[name]
    process_cache.trim()
    if not request.node.nodeid.startswith(RUNNING):
        keeping.close()
    elif not shelf.is_keeping():
        keeping.enter_context(process_cache.keep_unpacked())


def status(*arguments: object) -> int:
    """The exit status of a command."""
    with pytest.raises(SystemExit) as ended:
        main([str(a) for a in arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def sets(options: Iterable[str]) -> list[str]:
    """Options as a command takes them."""
    return [text for option in options for text in ("--set", option)]


@cache
def _once(scene: str, options: tuple[str, ...]) -> hl.Run:
    run = hl.run(scene, options, figures=False)
    for table in run.tables.values():
        table.rows.setflags(write=False)
    return run


def run_once(scene: str, options: Options = ()) -> hl.Run:
    """A run of a shipped scene, which all tests of a process share that ask for it."""
    return _once(scene, write_options(options))


def clock(name: str, timing: str, inputs: Sequence[str]) -> Component:
    """A block that puts out the stamp of its output, and `seen_<input>`: what its last step
    read. Connected stamp to input, every run shows its own causality."""
    seen = [f"seen_{i}" for i in inputs]
    block = Block(
        inputs=[Variable(i, (), "s") for i in inputs],
        states=[Variable(n, (), "s") for n in ["now", *seen]],
        outputs=[Variable(n, (), "s") for n in ["stamp", *seen]],
    )
    t, u, x = block.t, block.u, block.x
    if timing == "continuous":
        step = {"now": t + block.h, **{f"seen_{i}": u[i] for i in inputs}}
        output = {"stamp": x["now"], **{s: x[s] for s in seen}}
    else:
        step = {"now": t, **{s: x[s] for s in seen}}
        output = {"stamp": t, **{f"seen_{i}": u[i] for i in inputs}}
    initial = dict.fromkeys(["now", *seen], ca.SX(0))
    return block.component(name, "stamps", timing, initial=initial, step=step, output=output)  # type: ignore[arg-type]


BLOCKS = {
    "device": ("continuous", ["f"]),
    "controller": ("sampled", ["d", "m", "g"]),
    "hand": ("sampled", ["d"]),
    "mechanism": ("continuous", ["f"]),
    "graphics": ("continuous", ["m"]),
}
ROWS = [
    ("device.stamp", "hand.d"),
    ("device.stamp", "controller.d"),
    ("mechanism.stamp", "controller.m"),
    ("graphics.stamp", "controller.g"),
    ("controller.stamp", "device.f"),
    ("controller.stamp", "mechanism.f"),
    ("mechanism.stamp", "graphics.m"),
]


@pytest.fixture(scope="session")
def stamped(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Timeline, str], System]:
    """(timeline, coupling) -> a loop like the report's, of blocks that show their stamps."""
    folder = tmp_path_factory.mktemp("stamped")
    described = {n: describe(build(clock(n, t, i), folder)) for n, (t, i) in BLOCKS.items()}

    def make(timeline: Timeline, coupling: str) -> System:
        units = tuple(
            Fmu(n, d, timeline.of.get(n, "graphics" if n == "graphics" else "haptics"))
            for n, d in described.items()
        )
        return System(units, connected(units, ROWS, timeline)[0], timeline, Coupling(coupling))

    return make


BAR = """title = "A bar at 0.5 m/s"
duration = 0.25
[linkage]
operational_point = { body = "bar" }
[[linkage.body]]
name = "bar"
mass = 1.0
inertia = 0.01
[[linkage.joint]]
name = "slide"
type = "prismatic"
axis = 0.0
child = "bar"
[linkage.start_velocity]
slide = 0.5
"""


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    path = tmp_path / "bar.toml"
    path.write_text(BAR)
    return path
