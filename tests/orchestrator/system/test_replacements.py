"""FMUs in the place of blocks."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.commands.options import SceneOptions
from hapticlink.components.ports import Power
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.system.build_system import build_system
from tests.little_fmus import entries, slave, with_units
from tests.orchestrator.results.records import tables_of
from tests.shared_fixtures import status

SHORT = {"duration": 0.2, "graphics.rate": 40}


def spring(folder: Path, size: int = 3, output: str = "F_motor") -> Path:
    """A controller of a spring alone, with an input that the scene does not know."""
    inputs = entries("x_S", size) | entries("x_D", size) | entries("own", size)
    body = f"""for i in range(1, {size} + 1):
            stretch = values[f"x_S[{{i}}]"] - values[f"x_D[{{i}}]"]
            values[f"{output}[{{i}}]"] = 50.0 * stretch"""
    variables = ("input", inputs), ("output", entries(output, size))
    return slave(folder, "Spring", *variables, body=body)


@pytest.fixture(scope="module")
def own_files(tmp_path_factory):
    """The FMU of each block."""
    return hl.build("closed-loop-ideal", SHORT, out=tmp_path_factory.mktemp("fmus"))


@pytest.fixture(scope="module")
def own_run(tmp_path_factory):
    return hl.run("closed-loop-ideal", SHORT, out=tmp_path_factory.mktemp("run"), figures=False)


def test_native_fmus_of_fmi3_in_the_place_of_all_blocks_change_no_byte(tmp_path, own_run):
    """Arrays have the units of their entries, and meters, holds and clocks are those of the run."""
    native = {**SHORT, "packaging": "native"}
    files = hl.build("closed-loop-ideal", native, out=tmp_path / "fmus", fmi=3)
    assert files.keys() == own_run.run["fmus"].keys()
    swaps = [f'fmu.+={{replaces="{name}", path="{file}"}}' for name, file in files.items()]
    swapped = hl.run(
        "closed-loop-ideal", [*overrides.write_options(SHORT), *swaps], out=tmp_path, figures=False
    )
    assert swapped.run["energies"] == own_run.run["energies"]
    assert tables_of(own_run.folder) == tables_of(tmp_path)
    info = describe(files["virtual_mechanism"])
    assert [s.unit for s in info.port("x", "output")] == ["m", "m", "rad"]
    assert (info.fmi, info.block) == ("3", "virtual_mechanism")


@pytest.mark.parametrize("block", ["hand", "controller", "haptic_device", "virtual_environment"])
def test_a_block_s_own_fmu_in_its_place_changes_no_byte(tmp_path, own_files, own_run, block):
    """Connections, order, rate and timing are those of the block."""
    swap = {**SHORT, "fmu.+": {"replaces": block, "path": str(own_files[block])}}
    swapped = hl.run("closed-loop-ideal", swap, out=tmp_path, figures=False)
    assert swapped.run["replaced"] == {block: {"lost": [], "unfed": [], "mapped": {}}}
    assert swapped.run["connections"] == own_run.run["connections"]
    assert swapped.run["stop_when"] == own_run.run["stop_when"] != ""
    assert tables_of(own_run.folder) == tables_of(tmp_path)


def test_a_parameter_of_a_controller_of_ones_own_is_swept(tmp_path):
    """As the scene's own controller with twice the stiffness: a swap is one for each point."""
    inputs = entries("x_S", 3) | entries("x_D", 3)
    body = """for i in (1, 2, 3):
            stretch = values[f"x_S[{i}]"] - values[f"x_D[{i}]"]
            values[f"F_drift[{i}]"] = values[f"F_motor[{i}]"] = values["k"] * stretch"""
    variables = ("input", inputs), ("tunable", {"k": 50.0})
    outputs = ("output", entries("F_motor", 3) | entries("F_drift", 3))
    file = slave(tmp_path, "Gain", *variables, outputs, body=body)
    command = [
        "sweep",
        "closed-loop-ideal",
        "--set",
        "duration=0.2",
        "--swap",
        f"controller={file}",
    ]
    vary = ["--vary", "fmu.controller.start.k=50,100", "--jobs", "1"]
    assert status(*command, *vary, "--out", tmp_path / "swept") == 0
    with (tmp_path / "swept" / "table.csv").open() as table:
        rows = {row["fmu.controller.start.k"]: row for row in csv.DictReader(table)}
    for k in ("50", "100"):
        own = {"impedance": False, "topology": False, "teleoperation.damping": [0.0] * 3}
        own |= {"teleoperation.stiffness": [float(k)] * 3}
        options = {f"controller.{key}": value for key, value in own.items()}
        found = hl.run("closed-loop-ideal", {"duration": 0.2, **options})
        error = found.tracking().distance_mm.max()
        assert float(rows[k]["tracking_max_mm"]) == pytest.approx(error, rel=1e-6)
    assert rows["50"]["tracking_max_mm"] != rows["100"]["tracking_max_mm"]


def test_by_one_option_and_what_does_not_meet_is_listed(tmp_path, capsys):
    out, file = tmp_path / "run", spring(tmp_path)
    command = ["run", "closed-loop-ideal", "--set", "duration=0.2", "--swap", f"controller={file}"]
    command += ["--set", "fmu.controller.start.own=[1.0, 2.0, 3.0]"]  # acts after the swap
    assert status(*command, "--no-figures", "--out", out) == 0
    told = capsys.readouterr().out
    run = json.loads((out / "run.json").read_text())
    assert run["replaced"]["controller"]["unfed"] == ["own"]
    assert run["scene"]["fmu"][0]["start"] == {"own": [1.0, 2.0, 3.0]}
    lost = run["replaced"]["controller"]["lost"]
    assert "haptic_device.M -> controller.M" in lost
    assert "controller.F_drift -> virtual_mechanism.F_drift" in lost
    assert all(name in told for name in ("own", *lost))
    assert "virtual_mechanism.x -> controller.x_S" in run["connections"]
    assert not any("F_drift" in name for name in run["connections"])
    own = {"rate": "haptics", "timing": "sampled", "block": "controller"}
    assert run["fmus"]["controller"] == own


def test_a_port_of_another_size_is_refused_by_its_connection(tmp_path):
    swap = {"fmu.+": {"replaces": "controller", "path": str(spring(tmp_path, 2))}}
    with pytest.raises(SceneFault, match=r"virtual_mechanism\.x has 3 .* controller\.x_S takes 2"):
        hl.run("closed-loop-ideal", {**SHORT, **swap})


@pytest.mark.parametrize("block", ["hand", "controller", "virtual_mechanism"])
def test_an_fmu_that_fits_nothing_is_refused(tmp_path, block, capsys):
    """With what the block has and what the FMU has, as every command says it."""
    swap = f"{block}={spring(tmp_path, output='z')}"
    for command in ("run", "info"):
        assert status(command, "closed-loop-ideal", "--swap", swap) == 2
        told = " ".join(capsys.readouterr().err.split())
        assert "none of its outputs reaches another FMU" in told
        assert "the FMU has outputs z and inputs x_S, x_D, own." in told
    assert "[[connection]]" in told
    given = {"hand": "F[3]", "controller": "F_motor[3]", "virtual_mechanism": "x[3]"}
    assert given[block] in told


def test_ports_are_held_as_those_of_the_block_and_carry_its_power(tmp_path):
    """What a foreign FMU does not declare, where its ports have the block's names and sizes."""
    matrix = {f"Lambda_inv[{i},{j}]": float(i == j) for i in (1, 2, 3) for j in (1, 2, 3)}
    outputs = entries("x", 3) | entries("v", 3) | matrix | entries("P_c", 4)
    copy = slave(tmp_path, "Copy", ("input", entries("q_ref", 4)), ("output", outputs))
    inputs = entries("F_motor", 3) | entries("F_hand", 3)
    device = slave(
        tmp_path, "Device", ("input", inputs), ("output", entries("x", 3) | entries("x_true", 3))
    )
    files = {"virtual_environment": copy, "haptic_device": device}
    swaps = [f'fmu.+={{replaces="{name}", path="{file}"}}' for name, file in files.items()]
    with build_system(
        open_scene.load("closed-loop-ideal", ["controller.topology=false", *swaps])
    ) as system:
        about = {name: system.fmu[name].description for name in files}
        assert system.ends_when is None  # this device has no workspace_margin
    assert about["virtual_environment"].kinds == {"Lambda_inv": "semidefinite"}  # P_c has 4 entries
    rates = {f"x[{i}]": f"v[{i}]" for i in (1, 2, 3)}
    assert about["virtual_environment"].derivatives == rates
    carried = about["haptic_device"].power
    assert carried == {name: Power("x_true") for name in ("F_motor", "F_hand")}


def pull(folder: Path, *names: str) -> Path:
    """The constant hand of closed-loop-ideal."""
    return slave(folder, "Pull", ("output", dict(zip(names, (-0.5, 0.0, -0.0025), strict=True))))


@pytest.mark.parametrize(
    ("names", "given"),
    [
        (("force0", "force1", "force2"), ["--map", "F=force0,force1,force2"]),
        (("force0", "force1", "force2"), ["--map", "hand.F=force0, force1,force2"]),
        (("f_0", "f_1", "f_2"), []),
        (("F(0)", "F(1)", "F(2)"), []),
    ],
)
def test_an_fmu_of_other_names_acts_as_the_block(tmp_path, names, given, capsys):
    """As the scene's own hand, which pushes with the same constant wrench, in signals of its
    names, which figures and measures know."""
    file = pull(tmp_path, *names)
    own = hl.run("closed-loop-ideal", SHORT)
    sets = [f"--set={key}={value}" for key, value in SHORT.items()]
    command = ["run", "closed-loop-ideal", *sets, "--swap", f"hand={file}", *given]
    assert status(*command, "--no-figures", "--out", tmp_path / "run") == 0
    assert f"hand: F is what the FMU calls {', '.join(names)}" in capsys.readouterr().out
    found = hl.load(tmp_path / "run")
    assert found.run["replaced"]["hand"]["mapped"] == {"F": [*names]}
    assert np.array_equal(found["hand.F"], own["hand.F"])
    assert np.array_equal(found["haptic_device.x_true"], own["haptic_device.x_true"])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("F=force0,force1", "2 variables for the 3 entries of F"),
        ("G=force0,force1,force2", "no port of the block 'G'"),
        ("F=force0,force1,force3", "no variable of the FMU 'force3'"),
        ("F=force0,force0,force1", "force0 is given twice"),
        ("force0", "--map force0: write port=variable"),
        ("controller.F=force0", "no port of the block 'controller.F'"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(tmp_path, given, said, capsys):
    file = pull(tmp_path, "force0", "force1", "force2")
    command = ["info", "closed-loop-ideal", "--swap", f"hand={file}", "--map", given]
    assert status(*command) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert said in told
    assert "none of its outputs" not in told


def test_the_option_that_does_not_fit_is_told(tmp_path, capsys):
    file = pull(tmp_path, "force0", "force1", "force2")
    command = ["info", "closed-loop-ideal", "--swap", f"hand={file}"]
    assert status(*command, "--map", "F=force{0,1,2}", "--map", "G=force0") == 2
    assert """--set 'fmu.hand.map."G"=["force0"]'""" in " ".join(capsys.readouterr().err.split())


def test_a_scene_has_map_and_connections_too(tmp_path):
    file = pull(tmp_path, "pull0", "pull1", "pull2")
    swap = {"replaces": "hand", "path": str(file), "map": {"F": ["pull0", "pull1", "pull2"]}}
    assert hl.run("closed-loop-ideal", {**SHORT, "fmu.+": swap})["hand.F"][0, 0] == -0.5
    swap = {"replaces": "hand", "path": str(spring(tmp_path, output="z"))}
    wire = {"from": "hand.z", "to": "haptic_device.F_hand"}
    made = hl.run("closed-loop-ideal", {**SHORT, "fmu.+": swap, "connection.+": wire})
    assert "hand.z -> haptic_device.F_hand" in made.run["connections"]


def test_what_replaces_no_block_is_refused(tmp_path):
    path = str(spring(tmp_path))
    one = {"replaces": "controller", "path": path}
    for tables, message in (
        ([{**one, "replaces": "controler"}], "no block 'controler'; did you mean 'controller'"),
        ([{**one, "name": "mine"}], "'mine': it has that of controller"),
        ([{**one, "replaces": "hand_left"}], "no block 'hand_left'"),
        ([one, one], "'controller' is taken"),
    ):
        options = [text for table in tables for text in overrides.write_options({"fmu.+": table})]
        with pytest.raises(SceneFault, match=message):
            hl.scene("closed-loop-ideal", options)
    with pytest.raises(SceneFault) as raised:  # as it was typed
        hl.scene("closed-loop-ideal", SceneOptions(swap=["controler=/missing.fmu"]).options)
    said = "--swap controler=/missing.fmu: fmu[0]"
    assert f"{said}.path: there is no file" in str(raised.value)
    assert f"{said}.replaces: no block 'controler'" in str(raised.value)


def test_info_does_not_run_another_s_mechanism(tmp_path, capsys):
    """Its coordinates are its own, and it may hang."""
    swap = f"virtual_mechanism={spring(tmp_path, output='x')}"
    assert status("info", "closed-loop-ideal", "--swap", swap) == 0
    said = capsys.readouterr().out
    assert "virtual_mechanism has no ports for" in said
    assert "needed by the scene's own virtual_mechanism" in said


@pytest.mark.parametrize("isolate", [False, True])
def test_outputs_are_read_in_the_units_of_the_block(tmp_path, isolate):
    """A hand that gives .5 N, in kN: signals and summary have what the block's own would have."""
    starts = {"F[1]": 3.526708e-4, "F[2]": -3.545062e-4, "F[3]": 0.0}
    slave(tmp_path, "Pushes", ("output", starts))
    with_units(tmp_path / "Pushes.fmu", **{"F[1]": "kN", "F[2]": "kN"})
    own = {"path": str(tmp_path / "Pushes.fmu"), "replaces": "hand", "isolate": isolate}
    given = {"type": "constant", "wrench": [0.3526708, -0.3545062, 0.0]}
    options = {"duration": 0.2}
    found = hl.run("closed-loop-ideal", options | {"fmu": [own]})
    expected = hl.run("closed-loop-ideal", options | {"hand": given})
    assert found.run["units"]["hand.F[1]"] == "N"
    for name in ("hand.F", "haptic_device.x_true", "controller.F_drift"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, atol=1e-12)
    for told, own in zip(found.numbers, expected.numbers, strict=True):
        assert told == own


def turned(folder: Path) -> Path:
    """A spring whose axes and units are another's: x to the left in mm, forces of the device on
    it; its law is F = 50 N/m (x_S - x_D) in those of the scene."""
    inputs = {f"{end}_{axis}": 0.0 for end in ("world", "tool") for axis in "xyz"}
    body = """for axis, by in (("x", -1e-3), ("y", 1e-3), ("z", 1.0)):
            stretch = by * (values["world_" + axis] - values["tool_" + axis])
            values["tau_" + axis] = -50.0 * stretch"""
    outputs = {f"tau_{axis}": 0.0 for axis in "xyz"}
    return slave(folder, "Turned", ("input", inputs), ("output", outputs), body=body)


@pytest.mark.parametrize("packaging", ["python", "isolated"])
def test_signs_and_factors_of_a_map_make_it_the_same_law(tmp_path, packaging):
    """As the spring with the scene's own ports, in its signals, starts and energies."""
    alone = {"fmu.controller.isolate": packaging == "isolated"}
    common = {**SHORT, "controller.topology": False}
    maps = [
        "F_motor=-tau_{x,y,z}",
        "x_S=-0.001*world_x,world_y*1e-3,world_z",
        "x_D=tool_x*-0.001, tool_y*.001, tool_{z}",
    ]
    swap = SceneOptions([], [f"controller={turned(tmp_path)}"], maps)
    found = hl.run("closed-loop-ideal", [*swap.options, *overrides.write_options(common | alone)])
    plain = SceneOptions([], [f"controller={spring(tmp_path)}"], [])
    own = hl.run("closed-loop-ideal", [*plain.options, *overrides.write_options(common)])
    for name in ("controller.F_motor", "haptic_device.x_true", "virtual_mechanism.q"):
        np.testing.assert_allclose(found[name], own[name], rtol=1e-9, atol=1e-12)
    assert np.ptp(own["controller.F_motor"]) > 0.01
    told = found.run["replaced"]["controller"]["mapped"]
    assert [*told["x_S"]] == ["-0.001*world_x", "0.001*world_y", "world_z"]
    assert [*told["F_motor"]] == ["-tau_x", "-tau_y", "-tau_z"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("F=0*force0,force1,force2", "0*force0: a factor is a finite number other than 0"),
        ("F=1e999*force0,force1,force2", "a factor is a finite number other than 0"),
        ("F=-force{0,1,2", "-force{0: a brace without its other, or an empty entry: write a list"),
        ("F=force{0,,2}", "force{0,,2}: a brace without its other, or an empty entry"),
        ("F=force{0,1}", "2 variables for the 3 entries of F"),
        ("F=force0+1,force1,force2", "no variable of the FMU 'force0+1'"),
        (
            "F=force0+1,force1,force2",
            "what is more than a sign and a factor is for a [[connection]]",
        ),
        ("F=-force0,force0,force1", "force0 is given twice"),
        ("F=force0*1000,force1,force2", "force0 is in kN and is converted to N by itself; write"),
    ],
)
def test_a_factor_that_cannot_be_is_refused(tmp_path, given, said, capsys):
    file = pull(tmp_path, "force0", "force1", "force2")
    with_units(file, force0="kN", force1="kN")
    command = ["info", "closed-loop-ideal", "--swap", f"hand={file}", "--map", given]
    assert status(*command) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_a_variable_that_is_called_like_a_product_is_meant_itself(tmp_path):
    file = pull(tmp_path, "-f*2", "{a}", "b*3")
    swap = {"replaces": "hand", "path": str(file), "map": {"F": ["-f*2", "{a}", "b*3"]}}
    assert hl.run("closed-loop-ideal", {**SHORT, "fmu.+": swap})["hand.F"][0, 0] == -0.5


def test_a_matrix_is_not_scaled_by_its_entries(tmp_path):
    values = {f"P{i}{j}": float(i == j) for i in (1, 2, 3) for j in (1, 2, 3)}
    file = slave(tmp_path, "Copy", ("output", values))
    swap = {
        "replaces": "virtual_environment",
        "path": str(file),
        "map": {"P_c": "-P{1,2,3}{1,2,3}"},
    }
    with pytest.raises(SceneFault, match="P_c is a projector matrix, whose entries are not scaled"):
        hl.run("closed-loop-ideal", {**SHORT, "fmu.+": swap})
