"""What pages state about the results of their examples."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest

import hapticlink as hl
from tests.docs.pages import ROOT, blocks
from tests.shared_fixtures import run_once


def written(page: str, title: str, folder: Path) -> Path:
    """A file that a page gives, in `folder`."""
    (found,) = (b for b in blocks(ROOT / page, "toml", "python") if b.title == title)
    path = folder / title
    path.write_text(found.text, encoding="utf-8")
    return path


def test_watt_s_linkage_draws_watt_s_curve(tmp_path: Path) -> None:
    """With levers b = 60 mm, pivots 2a apart and a coupler of 2c = 30 mm, in the frame of the
    pivots: (x^2 + y^2) (x^2 + y^2 - a^2 - b^2 + c^2)^2 + 4 a^2 y^2 (x^2 + y^2 - b^2) = 0."""
    run = hl.run(written("docs/own-linkage.md", "watt.toml", tmp_path))
    assert run.fault is None
    x, y, theta = run["virtual_mechanism.x"].T
    a, b, c = np.hypot(0.06, 0.015), 0.06, 0.015
    along = np.array([0.06, -0.015]) / a
    u, v = along[0] * x + along[1] * y, along[0] * y - along[1] * x
    r2 = u**2 + v**2
    curve = r2 * (r2 - a**2 - b**2 + c**2) ** 2 + 4 * a**2 * v**2 * (r2 - b**2)
    # Slope of the left side at the double point, where the curve crosses itself: second order.
    assert np.abs(curve).max() < 1e-8 * a**6
    q = run["virtual_mechanism.q"]
    np.testing.assert_allclose(theta, q[:, 0] + q[:, 1], rtol=0, atol=1e-12)
    assert theta[0] == pytest.approx(-np.pi / 2, abs=1e-6)
    assert np.abs(x).max() < 0.15e-3
    assert [y.min(), y.max()] == pytest.approx([-0.02, 0.02], abs=0.5e-3)
    assert run.tracking().distance_mm.max() < 0.03
    assert set(run["virtual_environment.n_constraints"]) == {2.0}


def test_the_first_variation_ends_early() -> None:
    run = run_once("closed-loop-ideal", {"graphics.rate": 10, "controller.topology": False})
    assert run.fault is None
    end = run.run["end"]
    assert end["reason"] == "stop_when"
    assert end["time"] == pytest.approx(2.1, abs=0.05)


def test_the_first_example_prints_what_is_below_it() -> None:
    example, printed = blocks(ROOT / "README.md", "python", "text")
    command = [sys.executable, "-c", example.text]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == printed.text


def test_the_handle_stays_within_5_mm() -> None:
    distance = run_once("closed-loop-ideal").tracking().distance_mm
    assert 4 < distance.max() < 5


def test_an_own_controller_acts_as_the_scene_s_own_block(tmp_path: Path) -> None:
    """The FMU of pythonfmu and the block with the same law: the same to rounding."""
    script = written("docs/swap-an-fmu.md", "spring_coupling.py", tmp_path)
    build = str(Path(sys.executable).with_name("pythonfmu"))
    command = [build, "build", "-f", script.name]
    subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    swap = {"fmu.+": {"replaces": "controller", "path": str(tmp_path / "SpringCoupling.fmu")}}
    law = {
        "controller.impedance": False,
        "controller.topology": False,
        "controller.teleoperation.stiffness": [100.0, 100.0, 0.1],
        "controller.teleoperation.damping": [5.0, 5.0, 0.005],
    }
    stiffer = swap | {"fmu.controller.start.k": 200.0}
    own, built_in, k200 = (hl.run("closed-loop-ideal", o) for o in (swap, law, stiffer))
    assert own.tracking().distance_mm.max() == pytest.approx(9.8, abs=0.05)
    assert k200.tracking().distance_mm.max() == pytest.approx(5.9, abs=0.05)
    for signal in ("virtual_mechanism.x", "haptic_device.x_true", "controller.F_drift"):
        assert np.ptp(built_in[signal], axis=0).min() > 0
        np.testing.assert_allclose(own[signal], built_in[signal], rtol=1e-9, atol=1e-12)


def test_a_program_in_c_plus_plus_gets_the_pose_of_our_own_run(tmp_path: Path) -> None:
    """docs/drive.cpp with the one FMU of a scene, by the commands of docs/fmus-elsewhere.md."""
    if not shutil.which("c++") or fmpy.platform != "linux64":
        pytest.skip("needs Linux and a compiler of C++")
    shutil.copy(ROOT / "docs" / "drive.cpp", tmp_path)
    page = ROOT / "docs" / "fmus-elsewhere.md"
    (commands,) = (b.text for b in blocks(page, "sh") if "drive.cpp" in b.text)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-e", "-c", commands],
        cwd=tmp_path,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    ours = hl.run("closed-loop-ideal", {"hand.wrench": [0.5, 0.0, 0.0]})
    pose = done.stdout.splitlines()[-1].split()
    assert [*map(float, pose)] == ours["virtual_mechanism.x"][-1].tolist()


def test_fmpy_gets_the_pose_of_our_own_run_from_the_hand_s_force(tmp_path: Path) -> None:
    page = ROOT / "docs" / "fmus-elsewhere.md"
    (script,) = (b.text for b in blocks(page, "python") if "hand.F[1]" in b.text)
    hl.build("closed-loop-ideal", as_one=True, without="hand", out=tmp_path / "fmus")
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    ours = hl.run("closed-loop-ideal", {"hand.wrench": [0.5, 0.0, 0.0], "duration": 1.0})
    assert float(done.stdout.split()[-1]) == ours["virtual_mechanism.x"][-1, 0]


def test_libcosim_reaches_the_pose_of_our_jacobi(tmp_path: Path) -> None:
    """The script of docs/fmus-elsewhere.md; libcosim prints the last line."""
    pytest.importorskip("libcosimpy")
    page = ROOT / "docs" / "fmus-elsewhere.md"
    (script,) = (b.text for b in blocks(page, "python") if "libcosimpy" in b.text)
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    numbers = re.compile(r"\[[-+.e\d]+(, [-+.e\d]+)*\]")
    printed = next(line for line in done.stdout.splitlines() if numbers.fullmatch(line))
    options = {"coupling": "jacobi", "graphics.rate": 32, "duration": 1.0}
    ours = hl.run("closed-loop-ideal", options)["virtual_mechanism.x"][-1].tolist()
    assert json.loads(printed) == ours
