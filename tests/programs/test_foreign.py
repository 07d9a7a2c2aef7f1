"""FMUs of others, compiled with their C sources into a program: the bits of the run."""

from __future__ import annotations

import ctypes
import re
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException

from hapticlink.fmus.check import check_fmu, session
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.programs.build import build_program, program_files
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.standalone import page
from tests.fmus.named_fmu import Named
from tests.orchestrator import c_fmus, foreign_scenes, native_mass
from tests.programs import test_page_program
from tests.programs.built import needs_compiler, program
from tests.programs.comparison import differing, outputs, run
from tests.programs.with_sources import listing, table_fmu

pytestmark = needs_compiler

DISCARD, ERROR, FATAL, IS_TERMINATED = 2, 3, 4, 3

MASS = Path(c_fmus.__file__).with_name("mass_fmu.c").read_text()
HOSTILE = Path(c_fmus.__file__).with_name("hostile_fmu.c").read_text()


def mass_fmus(folder: Path) -> None:
    """The two masses of `native_mass`, with the source inside."""
    for description in native_mass.held(folder).values():
        listing(description.path, {"mass.c": MASS})


def scene(folder: Path, *tables: str, duration: float = 1.0, rate: int = 64) -> str:
    return str(foreign_scenes.scene(folder, "\n".join(tables), rate, duration))


def fmu(name: str, file: str, more: str = "") -> str:
    return f'[[fmu]]\nname = "{name}"\npath = "{file}.fmu"\n{more}'


wire = foreign_scenes.wire_table


def agree(path: str, options: tuple[str, ...], folder: Path) -> None:
    experiment = run(path, options, folder / "run")
    built, haptic = program(path, options), experiment.system.timeline.clocks[0].longest
    for step in (haptic, 7, 16 * haptic):
        assert [*differing(outputs(built, experiment, step), experiment)] == [], step


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> str:
    return two_in(tmp_path_factory.mktemp("two"))


def two_in(folder: Path) -> str:
    """Two FMUs of one source with other start values, a third one of which there are two instances,
    at another rate, with values for all types and a unit that is converted."""
    mass_fmus(folder)
    table_fmu(folder)
    given = 'start = { scale = 0.5, most = 900, text = "seven??" }\n'
    return scene(
        folder,
        fmu("one", "one"),
        fmu("two", "two"),
        fmu("fast", "table", given),
        fmu("slow", "table", "rate = 30\nstart = { u = 3.0 }\n"),
        wire("one.x", "two.x1"),
        wire("one.v", "two.v1"),
        wire("two.F", "one.F", "factor = -1.0"),
        wire("one.x", "fast.u"),
        wire("slow.y", "fast.on", "convert = false"),
    )


def test_two_different_fmus_and_two_instances_of_one_have_the_bits_of_the_run(
    two: str, tmp_path: Path
) -> None:
    agree(two, (), tmp_path)
    agree(two, ("coupling=jacobi",), tmp_path)


def test_the_values_of_its_types_and_its_resources_arrive(two: str, tmp_path: Path) -> None:
    experiment = run(two, (), tmp_path / "run")
    assert {float(v) for v in experiment.results.haptics["fast.gain"]} == {2.5}
    assert {float(v) for v in experiment.results.haptics["fast.size"]} == {7.0}
    with session(program(two)) as opened:
        variables = {v.name: v for v in opened.description.modelVariables}
        one = Named(opened).start()
        one.step(0.0, 0.5)
        assert one.get("fast.gain", "fast.size", "fast.steps") == [2.5, 7.0, 32.0]
        assert one.get("slow.scale", "slow.u") == [1.0, 3.0]
        before = one.get("fast.y")
        one.set(**{"fast.scale": 0.0})
        one.step(0.5, 0.25)
        assert one.get("fast.y") == before
        assert variables["slow.scale"].variability == "tunable"
        assert variables["fast.y"].unit == "mm"


def test_what_one_of_its_fmus_lacks_the_program_lacks(two: str) -> None:
    with session(program(two)) as opened:
        simulation = opened.description.coSimulation
        assert not simulation.canGetAndSetFMUstate
        assert not simulation.canSerializeFMUstate
        with pytest.raises(FMICallException):
            Named(opened).start().slave.getFMUState()
        assert "fast is an FMU that does not offer this" in opened.messages[-1]


def test_a_program_in_a_program(tmp_path: Path) -> None:
    """Both have the functions of the loop, and functions of FMI under prefixes; its state is saved,
    serialised and restored."""
    shutil.copy(program("pendulum", ("duration=0.5",)), tmp_path / "inner.fmu")
    path = scene(tmp_path, fmu("a", "inner"), fmu("b", "inner"), duration=0.5, rate=100)
    agree(path, (), tmp_path)
    assert check_fmu(program(path)) == []


def test_it_runs_in_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the blocks of a mechanism, by whose motion it is moved; one with resources, which are
    files, is refused."""
    mass_fmus(tmp_path)
    table_fmu(tmp_path)
    beside = f'fmu.+={{name="one", path="{tmp_path}/one.fmu"}}'
    wired = 'connection.+={from="virtual_mechanism.x[1]", to="one.F", factor=100, convert=false}'
    opened = load_viewed_scene("pendulum", (beside, wired))
    rows = test_page_program.under_node(page.html(opened, "page"), [])
    monkeypatch.setattr(test_page_program, "CHANGES", [])
    changed = test_page_program.changed_run(opened, lambda *_: None)
    assert np.abs(rows - changed).max() < 1e-9
    added = load_viewed_scene("pendulum", (f'fmu.+={{name="table", path="{tmp_path}/table.fmu"}}',))
    with pytest.raises(InputFault, match="table has resources, files that a page lacks"):
        page.html(added, "t")


@pytest.mark.parametrize(
    ("act", "rate", "end"), [("step_finish_9", 1, 9.0), ("step_middle_3", 0.25, 8.0)]
)
def test_an_fmu_that_ends_the_simulation_ends_the_program(
    act: str, rate: float, end: float, tmp_path: Path
) -> None:
    """At the end of its step, and within it."""
    listing(c_fmus.hostile_fmu(tmp_path), {"hostile.c": HOSTILE})
    path = scene(tmp_path, fmu(act, "hostile", f"rate = {rate}\n"), duration=16.0, rate=8)
    experiment = simulate(path, tmp_path / "run")
    assert experiment.outcome.end_time == end
    with session(program(path)) as opened:
        one = Named(opened).start()
        for i in range(int(end)):
            one.step(i, 1.0)
        with pytest.raises(FMICallException) as ended:
            one.step(end, 1.0)
        assert ended.value.status == DISCARD
        over = ctypes.c_int()
        one.slave.fmi2GetBooleanStatus(one.slave.component, IS_TERMINATED, ctypes.byref(over))
        assert over.value
        assert act in opened.messages[-1]


@pytest.mark.parametrize(
    ("failure", "status"), [("most = 3", ERROR), ("most = 3, failure = 4", FATAL)]
)
def test_a_failure_names_the_fmu_and_passes_its_message_on(
    failure: str, status: int, tmp_path: Path
) -> None:
    table_fmu(tmp_path)
    path = scene(tmp_path, fmu("weak", "table", f"start = {{ {failure} }}\n"))
    with session(program(path)) as opened:
        one = Named(opened).start()
        with pytest.raises(FMICallException) as failed:
            one.step(0.0, 1.0)
        assert failed.value.status == status
        own, last = opened.messages[-2:]
        assert own == "table: 3 steps of mine, 100%% of them"  # a format, which has no arguments
        assert last == "weak failed in its step from t = 0.046875 s"


@pytest.mark.parametrize("fmi", [2, 3])
def test_it_has_the_resources_of_each(fmi: int, two: str, tmp_path: Path) -> None:
    path = program(two, fmi=fmi)
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    assert "resources/fast_2/gain.txt" in names
    assert "resources/slow_3/gain.txt" in names
    experiment = run(two, (), tmp_path / "run")
    result = simulate_fmu(
        str(path), stop_time=0.5, output_interval=1 / 64, output=["fast.y", "fast.gain"]
    )
    rows = experiment.results.haptics
    assert result["fast.y"].tolist() == rows["fast.y"][: len(result)].tolist()
    assert set(result["fast.gain"]) == {2.5}
    assert rows["fast.y"][len(result) - 1] != 0.0


REFUSED = {
    "it brings no C sources": {},
    "it lists sources/other.c, which is not in it": {"other.c": None},
    "'mass.cpp' of its sources is no C file": {"mass.cpp": MASS},
    "of its sources, one_0_000.c does not compile": {"mass.c": MASS.replace("double", "dabble", 1)},
    "its sources do not define fmi2GetBoolean, ": {
        "mass.c": re.sub(r"UNUSED\(fmi2[GS]etBoolean\)", "", MASS)},
}  # fmt: skip


@pytest.mark.parametrize("reason", REFUSED)
def test_what_cannot_be_compiled_in_is_refused_with_the_reason(reason: str, tmp_path: Path) -> None:
    path = native_mass.held(tmp_path)["one"].path
    if REFUSED[reason]:
        listing(path, REFUSED[reason])
    loaded = open_scene.load(scene(tmp_path, fmu("one", "one")))
    with pytest.raises(InputFault) as refused:
        build_program(loaded, "one", out=tmp_path)
    assert reason in str(refused.value)
    assert str(path) in str(refused.value)


def test_an_fmu_of_fmi_3_is_refused(tmp_path: Path) -> None:
    path = c_fmus.c_fmu3(tmp_path)
    loaded = open_scene.load(scene(tmp_path, fmu("types", path.stem)))
    with pytest.raises(
        InputFault, match=r"it is of FMI 3.0; only those of FMI 2.0 are compiled in"
    ):
        build_program(loaded, "types", out=tmp_path)


def test_an_fmu_without_sources_can_be_left_out(tmp_path: Path) -> None:
    two = two_in(tmp_path)
    native_mass.held(tmp_path)  # both again, without sources
    with pytest.raises(InputFault, match="an FMU can be left out: --without one"):
        program_files(open_scene.load(two), "program")
    mass_fmus(tmp_path)
    native_mass.native(tmp_path, "one", native_mass.FLAGS[:2])
    with session(program(two, ("duration=0.5",), "one")) as opened:
        inputs = [v.name for v in opened.description.modelVariables if v.causality == "input"]
    assert inputs == ["one.x", "one.v", "two.a1", "slow.u"]
