"""A scene as one FMU: the bits of a run, its life as an FMU, and what it refuses."""

from __future__ import annotations

import ctypes
import random
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from hapticlink.fmus.check import check_fmu, initialize, session
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.holds.table import TABLE
from hapticlink.programs.build import build_program, program_files
from tests.fmus.named_fmu import Named
from tests.programs import life
from tests.programs.built import COMPILER, FLAGS, needs_compiler, program, sources
from tests.programs.comparison import differing, outputs, run

pytestmark = needs_compiler

DISCARD, LAST_SUCCESSFUL_TIME, IS_TERMINATED = 2, 2, 3
HALF = "duration=0.5"
DELAYED = (
    HALF,
    "graphics.rate=30",
    "hold=foh",
    'delays={"virtual_environment.P_c"={min=0.001,max=0.02,loss=0.05,seed=3}, '
    '"haptic_device.x -> controller.x_D"=0.004}',
)
SLOW = "mechanism_at=graphics; graphics.rate=100"
CASES = {
    "zoh": ("closed-loop-ideal", HALF),
    "foh with delays, jitter and loss": ("closed-loop-ideal", "; ".join(DELAYED)),
    "jitter and loss": (
        "closed-loop-ideal",
        f"{HALF}; graphics.rate=30; delays={{\"virtual_environment.Lambda_inv\"="
        "{min=0.0,max=0.03,loss=0.4,seed=4}}",
    ),
    "smooth, jacobi": ("closed-loop-ideal", f"{HALF}; hold=smooth; coupling=jacobi"),
    "drawn rate": ("closed-loop-ideal", f"{HALF}; graphics.rate={{min=20,max=90,seed=5}}"),
    "listed frames, a phase": (
        "closed-loop-ideal",
        f"{HALF}; graphics.rate=[0.01,0.05,0.3,0.6]; phases={{haptic_device=0.001}}",
    ),
    "passive": ("closed-loop-direct", f"{HALF}; graphics.rate=30; hold=passive"),
    "nepce, late": ("closed-loop-direct", f"{HALF}; graphics.rate=30; hold=nepce"),
    "pspm": ("closed-loop-direct", f"{HALF}; graphics.rate=30; hold=pspm"),
    "mechanism alone": ("pendulum", HALF),
    "derivatives and integrals": (
        "closed-loop-ideal",
        f'{HALF}; {SLOW}; holds={{"virtual_mechanism.x -> controller.x_S"="hermite",'
        '"virtual_mechanism.v -> controller.v_S"="slope"}',
    ),
    "a derivative": (
        "closed-loop-ideal", f'{HALF}; {SLOW}; holds={{"virtual_mechanism.x"="foh-derivative"}}',
    ),
    "early steps": (
        "closed-loop-ideal",
        f"{HALF}; mechanism_at=graphics; directions_from=mechanism; controller.bias=full; "
        "hold=model; downsampling=model; computing_time=0.01; graphics.rate={min=10,max=50,seed=2}",
    ),
    "observer beside": ("closed-loop", f"{HALF}; device.observer.beside=true"),
    "kalman": ("closed-loop", f"{HALF}; device.observer.law=kalman; haptics.rate=600"),
    "mean": ("two-users", "duration=0.2; downsampling=mean"),
    "in space": (
        "closed-loop-bricard", "duration=0.25; graphics.rate=10; hold=foh; sensing=encoders",
    ),
}  # fmt: skip
"""Scenes, and their options, each after "; "."""


@pytest.mark.parametrize("name", CASES)
def test_outputs_are_those_of_a_run_to_the_bit(name: str, tmp_path: Path) -> None:
    scene, given = CASES[name]
    options = tuple(given.split("; "))
    experiment = run(scene, options, tmp_path)
    path, haptic = program(scene, options), experiment.system.timeline.clocks[0].longest
    for step in (haptic, 16 * haptic, 7):
        found = outputs(path, experiment, step)
        assert [*differing(found, experiment)] == [], step
        if step == haptic:
            _measured(found.measured, experiment)


def _measured(measured: dict[str, float], experiment) -> None:
    """Energies and step errors are those that the run reports, but for the order of sums."""
    energies, errors = experiment.outcome.details.meters, experiment.outcome.details.step_errors
    connections = experiment.system.connection
    for name, energy in energies.items():
        c = connections[name]
        value = measured[f"energy.{c.target}.{c.target_port}"]
        scale = max(abs(energy.held), abs(energy.ideal), 1e-12)
        assert abs(value - energy.generated) < 1e-9 * scale, name
    timeline = experiment.system.timeline
    for fmu, error in errors.items():
        if timeline.end not in timeline.clock(timeline.of[fmu]).starts:
            continue  # the run does not take its last step, which would end after the run
        assert measured[f"step_error.{fmu}"] == pytest.approx(error.sum, rel=1e-9, abs=1e-15)


HOLDS = [name for name, row in TABLE.items() if not row.needs and not row.downsamples]


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_have_the_bits_of_their_runs(seed: int, tmp_path: Path) -> None:
    draw = random.Random(seed)
    options = [
        "duration=0.3",
        f"haptics.rate={draw.choice((250, 400, 512))}",
        f"graphics.rate={draw.choice((17, 30, 60, 100))}",
        f"hold={draw.choice(HOLDS)}",
        f"coupling={draw.choice(('jacobi', 'gauss-seidel', 'gauss-seidel-plants'))}",
        f"downsampling={draw.choice(('latest', 'mean'))}",
    ]
    if draw.random() < 0.7:
        low = draw.uniform(0.0, 0.01)
        options.append(
            f'delays={{"virtual_environment.P_c"={{min={low:.4f},max={low + 0.02:.4f},'
            f"loss={draw.choice((0.0, 0.1))},seed={seed}}}}}"
        )
    experiment = run("closed-loop-ideal", tuple(options), tmp_path)
    step = draw.choice((1, 11, 100)) * experiment.system.timeline.clocks[0].longest
    found = outputs(program("closed-loop-ideal", tuple(options)), experiment, step)
    assert [*differing(found, experiment)] == [], options


def test_it_lives_as_every_fmu_of_this_project() -> None:
    """Two instances, reset, loading again, a state saved, restored, serialised and restored into
    another instance."""
    assert check_fmu(program("closed-loop-ideal", DELAYED)) == []


def test_the_same_scene_gives_the_same_files() -> None:
    scene = open_scene.load("closed-loop-ideal", DELAYED)
    assert program_files(scene, "program") == program_files(scene, "program")


def test_without_the_hand_its_force_is_an_input(tmp_path: Path) -> None:
    """At its start value the scene's constant hand gives the bits of the run; another force moves
    the device elsewhere."""
    options = (HALF, "hand={type='constant', wrench=[0.4,0.1,0.0]}")
    experiment = run("closed-loop-ideal", options, tmp_path)
    path = program("closed-loop-ideal", options, "hand")
    found = outputs(path, experiment, 240)
    assert [*differing(found, experiment, skipped="hand.")] == []
    with session(path) as opened:
        inputs = {v.name: v for v in opened.description.modelVariables if v.causality == "input"}
        assert [*inputs] == ["hand.F[1]", "hand.F[2]", "hand.F[3]"]
        assert [float(v.start) for v in inputs.values()] == [0.4, 0.1, 0.0]
        fmu = Named(opened).start()
        fmu.set(**{"hand.F[1]": -0.4})
        fmu.step(0.0, 0.25)
        (moved,) = fmu.get("haptic_device.x[1]")
    row = found.values[found.ticks.tolist().index(240 * 8), found.names.index("haptic_device.x[1]")]
    assert moved < row


def test_a_time_between_ticks_is_the_tick_before() -> None:
    path = program("pendulum", (HALF,))
    with session(path) as opened:
        outputs = [v.name for v in opened.description.modelVariables if v.causality == "output"]
        one, two = (Named(opened, name).start() for name in ("one", "two"))
        one.step(0.0, 3.4 / 512)
        two.step(0.0, 3 / 512)
        assert one.get(*outputs) == two.get(*outputs)
        one.step(3.4 / 512, 0.6 / 512)
        two.step(3 / 512, 1 / 512)
        assert one.get(*outputs) == two.get(*outputs)


@pytest.mark.parametrize("scene", ["closed-loop-ideal", "five-bar"])
def test_outputs_depend_at_once_on_the_inputs_that_are_listed_alone(scene: str) -> None:
    """Without a step between, a changed input changes no output whose dependencies lack it: in a
    closed loop none."""
    with session(program(scene, (HALF,), "hand")) as opened:
        variables = opened.description.modelVariables
        outputs = [v.name for v in variables if v.causality == "output"]
        depends = {
            u.variable.name: [d.name for d in u.dependencies] for u in opened.description.outputs
        }
        fmu = Named(opened).start()
        fmu.step(0.0, 0.1)
        changed = set()
        for name in (v.name for v in variables if v.causality == "input"):
            before = fmu.get(*outputs)
            fmu.set(**{name: fmu.get(name)[0] + 0.5})
            after = fmu.get(*outputs)
            at_once = {n for n, a, b in zip(outputs, before, after, strict=True) if a != b}
            assert all(name in depends[output] for output in at_once)
            changed |= at_once
        assert changed == {output for output, names in depends.items() if names}
        assert bool(changed) == (scene == "five-bar")
        fmu.step(0.1, 0.1)
        assert fmu.get(*outputs) != after


def test_wrong_calls_are_errors_that_name_block_and_signal() -> None:
    path = program("closed-loop-ideal", DELAYED, "hand")
    with session(path) as opened:
        names = {v.name: v.valueReference for v in opened.description.modelVariables}
        fixed = next(v for v in opened.description.modelVariables
                     if v.causality == "parameter" and v.variability == "fixed")  # fmt: skip
        slave = opened.instance()

        def fails(call, *arguments) -> str:
            with pytest.raises(FMICallException):
                call(*arguments)
            return opened.messages[-1]

        assert "is instantiated" in fails(slave.doStep, 0.0, 0.1)
        assert "starts at 0 s or later" in fails(slave.setupExperiment, None, -1.0)
        initialize(slave)
        assert "is initialised" in fails(slave.enterInitializationMode)
        assert "unknown value reference 99999" in fails(slave.getReal, [99999])
        assert "unknown value reference 99999" in fails(slave.setReal, [99999], [0.0])
        assert "hand.F[1] cannot be nan" in fails(slave.setReal, [names["hand.F[1]"]], [np.nan])
        message = fails(slave.setReal, [names["haptic_device.x[1]"]], [0.0])
        assert message == "haptic_device.x[1] is no input or parameter"
        message = fails(slave.setReal, [fixed.valueReference], [1.0])
        assert message.startswith(f"parameter {fixed.name} is fixed")
        slave.doStep(0.0, 0.1)
        assert "the program stands at 0.1" in fails(slave.doStep, 0.0, 0.1)
        assert "has no end" in fails(slave.doStep, 0.1, -0.1)
        assert "has no end" in fails(slave.doStep, 0.1, float("inf"))
        before = slave.getReal([*names.values()])
        slave.doStep(0.1, 0.1)
        assert before != slave.getReal([*names.values()])
        slave.terminate()
        assert "is terminated" in fails(slave.doStep, 0.2, 0.1)


def test_a_state_whose_bytes_are_damaged_is_refused() -> None:
    path = program("closed-loop-ideal", DELAYED)
    with session(path) as opened:
        fmu = Named(opened).start()
        fmu.step(0.0, 0.1)
        whole = fmu.slave.serializeFMUState(fmu.slave.getFMUState())
        for place in (len(whole) // 7, len(whole) // 2, len(whole) - 1):
            damaged = bytearray(whole)
            damaged[place] ^= 4
            with pytest.raises(FMICallException):
                fmu.slave.deserializeFMUState(bytes(damaged))
            assert "damaged" in opened.messages[-1]
        fmu.slave.setFMUState(fmu.slave.deserializeFMUState(whole))
        fmu.step(0.1, 0.1)


def test_steps_that_each_begin_a_little_early_do_not_take_the_program_back() -> None:
    with session(program("pendulum", (HALF,))) as opened:
        fmu = Named(opened).start()
        fmu.step(0.0, 0.1)
        early = 0.1 - 4e-7  # less than 1/1000 tick
        with pytest.raises(FMICallException):
            fmu.step(early, 1e-12)
        assert "goes back: the program stands at 0.1" in opened.messages[-1]
        fmu.step(early, 0.1)


def test_a_scene_that_diverges_becomes_a_program(tmp_path: Path) -> None:
    """What its latencies need is known from its run, up to where that fails."""
    options = (HALF, "controller.teleoperation.stiffness=[1e6,1e6,1e3]", *DELAYED[1:])
    assert simulate("closed-loop-ideal", tmp_path, options).outcome.reason == "diverged"
    assert program("closed-loop-ideal", options).exists()


def test_a_run_that_diverges_names_the_output() -> None:
    path = program("closed-loop-ideal", DELAYED, "hand")
    with session(path) as opened:
        fmu = Named(opened).start()
        fmu.set(**{"hand.F[1]": 1e300})
        with pytest.raises(FMICallException):
            fmu.step(0.0, 0.4)
        assert re.fullmatch(r"output [a-z_]+\.\S+ is .* at t = 0 s: .*", opened.messages[-1])
        with pytest.raises(FMICallException):
            fmu.step(0.0, 0.1)
        assert "has failed; reset it or restore a state" in opened.messages[-1]
        fmu.slave.reset()
        fmu.start().step(0.0, 0.1)


def test_what_cannot_go_is_refused_with_the_reason(tmp_path) -> None:
    scene = open_scene.load("closed-loop-ideal", ("coupling=iterated",))
    with pytest.raises(InputFault, match="cannot become one program") as refused:
        build_program(scene, "closed-loop-ideal", out=tmp_path)
    assert "steps are repeated by Python" in str(refused.value)
    with pytest.raises(InputFault, match="no block 'foot'"):
        build_program(open_scene.load("pendulum"), "pendulum", out=tmp_path, without="foot")


def test_the_fmu_that_is_built_has_the_bits_of_the_run(tmp_path: Path) -> None:
    """Compiled as for others, optimised and with sources inside."""
    experiment = run("single-body", (HALF,), tmp_path / "run")
    scene = open_scene.load("single-body", (HALF,))
    path = build_program(scene, "single-body", out=tmp_path)
    haptic = experiment.system.timeline.clocks[0].longest
    assert [*differing(outputs(path, experiment, 16 * haptic), experiment)] == []


def test_a_condition_to_stop_ends_the_simulation(tmp_path: Path) -> None:
    """The doStep that finds it returns discard, the FMU is terminated, and stands where the run
    ends."""
    options = ("duration=0.5", "stop_when=virtual_mechanism.v[1] < -0.3")
    experiment = run("pendulum", options, tmp_path)
    assert experiment.outcome.reason == "stop_when"
    with session(program("pendulum", options)) as opened:
        fmu = Named(opened).start()
        slave = fmu.slave
        with pytest.raises(FMICallException) as ended:
            fmu.step(0.0, 0.5)
        assert ended.value.status == DISCARD
        rows = experiment.results.haptics
        assert fmu.get(*rows.columns[1:]) == rows.rows[-1, 1:].tolist()
        time, terminated = ctypes.c_double(), ctypes.c_int()
        slave.fmi2GetRealStatus(slave.component, LAST_SUCCESSFUL_TIME, ctypes.byref(time))
        slave.fmi2GetBooleanStatus(slave.component, IS_TERMINATED, ctypes.byref(terminated))
        assert time.value == experiment.outcome.end_time
        assert terminated.value


def test_it_has_the_outputs_that_the_scene_records(tmp_path: Path) -> None:
    options = (HALF, 'record.signals=["virtual_mechanism.x"]')
    experiment = run("closed-loop-ideal", options, tmp_path)
    found = outputs(program("closed-loop-ideal", options), experiment, 240)
    assert found.names == [f"virtual_mechanism.x[{i}]" for i in (1, 2, 3)]
    assert [*differing(found, experiment)] == []


@pytest.mark.parametrize("fmi", [2, 3])
def test_it_says_who_has_made_it(fmi: int) -> None:
    scene = open_scene.load("pendulum", ())
    files = program_files(scene, "program", fmi=fmi)
    root = ET.fromstring(files["modelDescription.xml"])
    assert [root.get(name) for name in ("author", "license")] == ["The hapticlink authors", "MIT"]


@pytest.mark.parametrize("fmi", [2, 3])
def test_its_memory_is_its_own(fmi: int, tmp_path: Path) -> None:
    """The life of two instances under the sanitizers for addresses and undefined behaviour."""
    scene = open_scene.load("closed-loop-direct", ("graphics.rate=30", "hold=passive"))
    files = program_files(scene, "program", fmi=fmi)
    flags = ("-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", *FLAGS)
    try:
        made = life.made(str(COMPILER), sources(files), fmi, tmp_path, flags)
    except subprocess.CalledProcessError as failed:
        if "cannot find" not in failed.stderr:
            raise AssertionError(failed.stderr) from failed
        pytest.skip("the compiler has no sanitizers")
    life.lived([made], files["modelDescription.xml"].decode())


def test_programs_of_tests_are_left_to_pytest(tmp_path_factory) -> None:
    """Which removes folders of former sessions; those of processes that were killed, too."""
    made = program("pendulum", (HALF,))
    assert made.is_relative_to(tmp_path_factory.getbasetemp().parent)


def test_it_begins_at_the_start_time_that_it_is_told(tmp_path: Path) -> None:
    """As a run with that `start_time`, of which the sine of the hand is another than from 0 on."""
    sine = "{amplitude=[0.3,0.1,0.0],frequency=[1.1,0.7,0.5]}"
    options = ("duration=0.1", f'hand={{type="profile",table={sine}}}')
    experiment = run("closed-loop-ideal", (*options, "start_time=2.0"), tmp_path / "later")
    path = program("closed-loop-ideal", options)
    step = experiment.system.timeline.clocks[0].longest
    found = outputs(path, experiment, step)
    assert [*differing(found, experiment)] == []
    first = run("closed-loop-ideal", options, tmp_path / "first")
    assert [*differing(found, first)] != []
