"""Declarations of ports come from the FMU, under any instance name, for two instances and in an
SSP; nothing is inferred from a port's name."""

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.blocks import BLOCKS as BUILDERS
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.experiment import simulate
from tests.little_fmus import python_fmu, slave, with_units
from tests.orchestrator.foreign_scenes import fmu_table, ran, run, scene, wire_table
from tests.orchestrator.results.records import tables_of
from tests.orchestrator.systems import system_of
from tests.shared_fixtures import sets, status

# --- FMUs of others -----------------------------------------------------------------------

ENTRIES = ("1,1", "1,2", "2,1", "2,2")
ROTATION = np.array([0.955, -0.296, 0.296, 0.955])


def rotating(folder: Path, matrix: str) -> str:
    """A rotation matrix on a port `matrix` at 16 Hz, held at first order by a fast FMU."""
    inputs = {f"u[{e}]": 0.0 for e in ENTRIES} | {"F_hand": 0.0}
    for name, port in (("Slow", matrix), ("Fast", "seen")):
        entries = {f"{port}[{e}]": x for e, x in zip(ENTRIES, ROTATION.tolist(), strict=True)}
        body = f"values.update({{f'seen[{{e}}]': values[f'u[{{e}}]'] for e in {ENTRIES}}})"
        outputs = entries | {"x": 0.0, "v": 0.0}
        body = body if port == "seen" else ""
        slave(folder, name, ("input", inputs), ("output", outputs), body=body)
    slow, fast = fmu_table("slow", "Slow", "rate = 16\n"), fmu_table("fast", "Fast")
    return f'hold = "foh"\n{slow}{fast}{wire_table(f"slow.{matrix}", "fast.u")}'


@pytest.mark.parametrize("matrix", ["M", "P_c", "Lambda_inv", "D", "contacts"])
def test_a_foreign_matrix_passes_unchanged_whatever_its_name(tmp_path, matrix):
    found = ran(tmp_path, rotating(tmp_path, matrix))
    assert found.run["holds"] == {f"slow.{matrix} -> fast.u": "foh"}
    assert found.run["held_as"] == {}
    seen = np.stack([found.haptics[f"fast.seen[{e}]"] for e in ENTRIES], 1)
    np.testing.assert_array_equal(seen[1:], np.broadcast_to(ROTATION, seen[1:].shape))


def test_a_scene_says_what_a_foreign_matrix_is(tmp_path):
    text = rotating(tmp_path, "M") + '[kinds]\n"slow.M" = "semidefinite"\n'
    _, found = run(tmp_path, text)
    assert found.run["held_as"] == {"slow.M -> fast.u": "semidefinite"}
    assert abs(found.haptics["fast.seen[1,2]"][-1]) < 1e-15


@pytest.mark.parametrize(
    ("hold", "why"),
    [
        ("foh-derivative", "does not put out the derivative of x"),
        ("passive", "it is not a declared power connection"),
    ],
)
def test_nothing_is_guessed_from_the_name_of_a_foreign_port(tmp_path, hold, why):
    text = rotating(tmp_path, "M") + wire_table("slow.x", "fast.F_hand", f'hold = "{hold}"\n')
    with pytest.raises(SceneFault, match=why):
        system_of(scene(tmp_path, text))


POSES = {f"{name}[{i}]": -1.0 for name in ("x", "x_true", "F", "F_drift") for i in (1, 2, 3)}
SCALARS = {"x": 1.0, "F": 1.0, "F_env": 1.0, "q": 1.0, "n_constraints": 1e5, "branch_ok": 0.0,
           "x_true": 1.0, "workspace_margin": -1.0, "closure_error": 1.0}  # fmt: skip


@pytest.mark.parametrize("outputs", [POSES | {"workspace_margin": -1.0}, SCALARS])
@pytest.mark.parametrize("more", ["", 'stop_when = "haptic_device.workspace_margin < 0"\n'])
def test_an_fmu_is_no_block_for_its_name(tmp_path, outputs, more):
    """Neither what its outputs are, nor that it has diverged or left a workspace."""
    slave(tmp_path, "Any", ("output", outputs))
    fmus = "".join(fmu_table(name, "Any") for name in (*BUILDERS, "other"))
    made = hl.run(scene(tmp_path, more + fmus), out=tmp_path / "out")
    assert made.fault is None
    assert made.figures() == {}
    assert made.run["warnings"] == []
    assert {fmu["block"] for fmu in made.run["fmus"].values()} == {None}


@pytest.mark.parametrize("name", ["controller", "gives"])
def test_what_an_fmu_puts_in_counts_whatever_its_name(tmp_path, name):
    """A force of 3 N and more, held over 1/16 s and pushed along 2 m, generates less than it
    does."""
    for fmu, body in (("Gives", "self.y = 3.0 + time"), ("Takes", "self.y = 4.0 * time")):
        with_units(python_fmu(tmp_path, fmu, body), y="N" if fmu == "Gives" else "m", u="N")
    text = fmu_table(name, "Gives", "rate = 16\n") + fmu_table("takes", "Takes")
    text += wire_table(f"{name}.y", "takes.u", "hold = 'foh'\n")
    found = ran(tmp_path, text + '[[power]]\neffort = "takes.u"\ndisplacement = "takes.y"\n')
    (energy,) = found.run["energies"].values()
    assert 1e-6 < energy["generated"] < energy["ideal"]
    assert found.run["unstable"] == ""


DERIVATIVES = (
    "\n"
    + fmu_table("slow", "Slow", "rate = 16\nderivatives = {{ {} }}\n")
    + fmu_table("fast", "Fast")
    + wire_table("slow.x", "fast.F_hand", 'hold = "foh-derivative"\n')
)


def test_a_scene_says_which_output_is_a_derivative_and_its_ssp_too(tmp_path):
    rotating(tmp_path, "M")
    path = scene(tmp_path, DERIVATIVES.format('x = "v"'))
    assert status("export", path, "--out", tmp_path) == 0
    for made in (path, tmp_path / "scene.ssp"):
        (wire,) = system_of(made).connections
        assert wire.hold == "foh-derivative"


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ('y = "v"', "no output 'y'; there are M, x, v"),
        ('x = "F_hand"', "F_hand is no output, its causality is input"),
        ('x = "M"', "M has 4 entries for the 1 of x"),
    ],
)
def test_a_derivative_that_cannot_be_is_refused(tmp_path, said, why):
    rotating(tmp_path, "M")
    with pytest.raises(SceneFault, match=why) as refused:
        system_of(scene(tmp_path, DERIVATIVES.format(said)))
    assert "line 9: fmu[0] (slow).derivatives" in str(refused.value)


# --- the project's own, under other names -------------------------------------------------

WIRES = (
    ("mechanism.x", "control.x_S"),
    ("mechanism.v", "control.v_S"),
    ("device.x", "control.x_D"),
    ("device.v", "control.v_D"),
    ("device.M", "control.M"),
    ("control.F_motor", "device.F_motor"),
    ("control.F_drift", "mechanism.F_drift"),
    ("mechanism.Lambda_inv", "control.Lambda_inv"),
    ("mechanism.P_c", "control.P_c"),
)
BLOCKS = {"control": "controller", "device": "haptic_device", "mechanism": "virtual_mechanism"}


def twice(folder: Path, start: str = "") -> Path:
    """Two loops of the blocks of `closed-loop-direct`, by other names; the mechanisms at 30 Hz."""
    assert status("build", "closed-loop-direct", "--out", folder) == 0
    text = 'hold = "foh"\n'
    for side in ("left", "right"):
        for name, block in BLOCKS.items():
            rate = "rate = 30\n" if name == "mechanism" else ""
            text += fmu_table(f"{side}_{name}", block, rate)
            text += start if (side, name) == ("right", "control") else ""
        for source, target in WIRES:
            text += wire_table(f"{side}_{source}", f"{side}_{target}")
    return scene(folder, text, rate=512)


HOLDS = [
    f'holds."{side}_{end}"="{hold}"'
    for side in ("left", "right")
    for end, hold in (
        ("control.x_S", "pspm"), ("control.v_S", "pspm"), ("mechanism.F_drift", "passive"),
    )
]  # fmt: skip


def test_two_of_each_block_keep_what_their_ports_mean(tmp_path):
    made = system_of(twice(tmp_path, "start.K_pc = [5, 6, 7]\n"), *HOLDS)
    for side in ("left", "right"):
        kinds = {c.source_port: c.kind for c in made.connections if c.source.startswith(side)}
        assert {kinds.pop(m) for m in ("Lambda_inv", "M")} == {"semidefinite"}
        assert kinds.pop("P_c") == "projector"
        assert set(kinds.values()) == {None}
    power = {p.effort: (p.displacement, p.sign) for p in made.energy.power}
    assert power["left_mechanism.F_drift"] == ("left_mechanism.x", -1.0)
    assert power["right_device.F_motor"] == ("right_device.x_true", 1.0)
    gains = {s.set_position: (s.position, s.stiffness, s.damping) for s in made.energy.springs}
    damping = (20.0, 20.0, 0.02)
    assert gains == {
        "left_control.x_S": ("left_control.x_D", (100.0, 100.0, 0.1), damping),
        "right_control.x_S": ("right_control.x_D", (5.0, 6.0, 7.0), damping),
    }
    assert not made.refused
    assert {c.hold for c in made.connections} == {None, "foh", "pspm", "passive"}


def test_the_derivative_is_the_blocks_own_too(tmp_path):
    holds = [f'holds."left_mechanism.{port}"="foh-derivative"' for port in ("x", "Lambda_inv")]
    path = twice(tmp_path)
    assert system_of(path, holds[0])
    with pytest.raises(SceneFault, match="does not put out the derivative of Lambda_inv"):
        system_of(path, holds[1])


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("start.K_pc = [-5, 6, 7]\n", r"a gain of its spring is below 0: \[-5.0, 6.0, 7.0\]"),
        ("", "sets no spring whose energy is known"),
    ],
)
def test_a_spring_of_gains_that_do_not_do_is_refused(tmp_path, more, why):
    path = twice(tmp_path, more)
    if not more:  # gains that come over a connection are not known before the run
        wire = wire_table("left_mechanism.x", "right_control.K_pc", "convert = false\n")
        path.write_text(path.read_text() + wire)
    with pytest.raises(SceneFault, match=why):
        system_of(path, *HOLDS)


def test_an_ssp_whose_components_are_renamed_runs_to_the_same_bits(tmp_path):
    options = ("duration=0.2", "hold=pspm", "holds.virtual_mechanism.F_drift=passive")
    assert status("export", "closed-loop-direct", "--out", tmp_path, *sets(options)) == 0
    path, renamed = tmp_path / "closed-loop-direct.ssp", tmp_path / "renamed.ssp"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(renamed, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name.endswith(".ssd"):
                blocks = "|".join(("hand", *BLOCKS.values()))
                content = re.sub(rf"\b({blocks})\b(?!\.fmu)", r"my_\1", content.decode()).encode()
            new.writestr(name, content)
    own = simulate("closed-loop-direct", tmp_path / "own", options)
    again = simulate(str(renamed), tmp_path / "renamed")
    assert again.outcome.fault is None
    rows = [
        {name: table.split(b"\n", 1)[1] for name, table in tables_of(tmp_path / run).items()}
        for run in ("own", "renamed")
    ]
    assert rows[0] == rows[1]
    for key in ("holds", "held_as", "energies"):
        expected, found = (experiment.results.run[key] for experiment in (own, again))
        assert {re.sub(r"\bmy_", "", name): value for name, value in found.items()} == expected
    assert len(own.results.run["energies"]) == 2


def test_none_is_a_kind_too(tmp_path):
    """Mobility, its entries held each for itself; P_c stays what it is."""
    option = 'kinds."virtual_environment.Lambda_inv"="none"'
    made = system_of("closed-loop-ideal", "hold=foh", option)
    kinds = {c.source_port: c.kind for c in made.connections if c.source == "virtual_environment"}
    assert kinds == {"Lambda_inv": None, "P_c": "projector"}
