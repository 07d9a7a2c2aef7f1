"""Lengths and offsets from angles: devices of which all is known, with errors of construction."""

from __future__ import annotations

import json

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.fit.kinematics import FittedKinematics, fit_kinematics, read_angles
from hapticlink.commands import main
from hapticlink.components.device.models import device_model
from hapticlink.components.specs.device import Device

LENGTH, ANGLE = 2.5e-4, 3.7e-3
"""Standard deviations of the errors of construction: m, rad."""


def device_of(name: str) -> Device:
    return hl.scene("closed-loop", {"device.extends": name}).device


def measured(
    device: Device, errors: dict[tuple[str, int], float], spread: tuple[float, ...], n: int = 60
) -> tuple[np.ndarray, np.ndarray]:
    """Counted angles (n, e) and places (n, k) of a device with `errors` of its parameters and of
    the offsets of its encoders, at places about the start."""
    model = device_model(device)
    p = {name: ca.SX(value) for name, value in model.numbers.items()}
    offsets = np.zeros(len(device.encoders))
    for (name, entry), error in errors.items():
        if name.startswith("offset."):
            offsets[entry] = error
        else:
            p[name][entry] += error
    z = ca.SX.sym("z", len(model.start_place))
    told = ca.Function("told", [z], [model.angles(z, p), model.handle(z, p)])
    draw = np.random.default_rng(7)
    resolution = np.array([e.resolution for e in device.encoders])
    rows = [told(model.start_place + draw.uniform(-1, 1, len(spread)) * spread) for _ in range(n)]
    angles = np.array([np.array(a).ravel() for a, _ in rows]) + offsets
    return np.round(angles / resolution) * resolution, np.array(
        [np.array(h).ravel() for _, h in rows]
    )


def check(fitted: FittedKinematics, errors: dict[tuple[str, int], float]) -> None:
    """Every value that is told is right within five of its standard deviations."""
    by_key = {f"{name}[{entry + 1}]": error for (name, entry), error in errors.items()}
    told = [each for each in fitted.estimates if np.isfinite(each.spread)]
    for each in told:
        wanted = each.assumed + by_key.get(each.key, 0.0)
        assert abs(each.value - wanted) < 5 * each.spread + 1e-9, each.key
    assert told


def errors_of(names: dict[str, int], seed: int = 3) -> dict[tuple[str, int], float]:
    draw = np.random.default_rng(seed)
    return {
        (name, entry): draw.normal(0.0, ANGLE if name.startswith("offset") else LENGTH)
        for name, entry in names.items()
    }


TWIN_ARMS = {
    **{f"{p}_elbow_{s}.at_parent": 0 for p in "ab" for s in ("left", "right")},
    **{"a_crank.at_parent": 0, "loop1.at1": 0, "loop2.at1": 0, "loop3.at1": 0},
    **{f"offset.{name}": i for i, name in enumerate(("a_left", "a_right", "b_left", "b_right"))},
}
TWIN_KNOWN = [
    *(f"{p}_{s}.at_parent" for p in "ab" for s in ("left", "right")),
    *("a_crank.at_child", "loop1.at2", "loop2.at2", "loop3.at2"),
]


def test_the_twin_tells_its_arms_and_offsets() -> None:
    """Four encoders, three directions: one residual a sample tells 12 of 12."""
    device, errors = device_of("twin"), errors_of(TWIN_ARMS)
    angles, _ = measured(device, errors, (0.07, 0.07, 1.2), 1500)
    fitted = fit_kinematics(device, angles, known=TWIN_KNOWN)
    assert fitted.told == len(fitted.estimates) == 12
    assert not fitted.gauges
    check(fitted, errors)
    before, after = fitted.counts
    assert before > 3 * after
    assert after < 0.3  # what counting alone leaves of four angles with three unknowns is less
    lengths = [each.spread for each in fitted.estimates if each.unit == "m"]
    assert max(lengths) < 5e-3


def test_what_the_twin_cannot_tell_has_a_name() -> None:
    device = device_of("twin")
    angles, _ = measured(device, {}, (0.05, 0.05, 0.8), 150)
    fitted = fit_kinematics(device, angles)
    # Eight lengths, four bases, the crank's two ends, four offsets.
    assert len(fitted.estimates) == 22
    assert fitted.told == 17
    assert {*fitted.gauges} == {
        "where the device stands", "how it is turned", "its size",
        "where the handle is on its body",
    }  # fmt: skip
    assert fitted.gauges["where the handle is on its body"] == (
        "a_crank.at_child[1]", "loop2.at2[1]",
    )  # fmt: skip
    assert not [e.key for e in fitted.estimates if np.isfinite(e.spread) and e.unit == "m"]


KIT = {
    "left_elbow.at_parent": 0, "right_elbow.at_parent": 0, "loop1.at2": 0,
    "right.at_parent": 0, "offset.left": 0, "offset.right": 1,
}  # fmt: skip


def test_a_kit_tells_nothing_by_angles_and_lengths_by_places() -> None:
    device, errors = device_of("2diy"), errors_of(KIT)
    angles, places = measured(device, errors, (0.03, 0.03), 25)
    with pytest.raises(hl.InputFault, match=r"no more encoders than directions.*add known places"):
        fit_kinematics(device, angles)
    known = ["left.at_parent", "loop1.at1", "operational_point.at"]
    fitted = fit_kinematics(device, angles, places, known)
    assert not fitted.gauges
    check(fitted, errors)


def test_the_command_reads_a_log(tmp_path, capsys) -> None:
    device, errors = device_of("2diy"), errors_of(KIT)
    angles, places = measured(device, errors, (0.03, 0.03), 25)
    log = tmp_path / "held.csv"
    names = [f"haptic_device.q[{i}]" for i in (1, 2)] + ["place[1]", "place[2]"]
    rows = np.column_stack([np.arange(25.0), angles, places])
    np.savetxt(log, rows, "%.17g", ",", header=",".join(["time", *names]), comments="")
    command = [
        "fit", str(log), "--kinematics", "--set", "device.extends=2diy", "--known",
        "left.at_parent,loop1.at1,operational_point.at", "--out", str(tmp_path / "fit"),
    ]  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert "7 of 7 unknowns can be told" in said
    assert json.loads((tmp_path / "fit" / "fit.json").read_text())["told"] == 7


def test_a_log_that_tells_too_little_is_refused() -> None:
    device = device_of("twin")
    angles, _ = measured(device, {}, (1e-3, 1e-3, 0.02), 40)
    with pytest.raises(hl.InputFault, match=r"the log tells too little.*through its workspace"):
        fit_kinematics(device, angles, known=["a_left.at_parent"])


def test_refusals(tmp_path) -> None:
    device = device_of("2diy")
    with pytest.raises(hl.InputFault, match=r"no parameter 'left.at'; there are left.at_parent"):
        fit_kinematics(device, np.zeros((3, 2)), known=["left.at"])
    (tmp_path / "log.csv").write_text("time,haptic_device.q[1]\n0.0,1.0\n")
    with pytest.raises(hl.InputFault, match=r"it needs haptic_device.q\[1\] to \[2\]"):
        read_angles(tmp_path / "log.csv", device)
