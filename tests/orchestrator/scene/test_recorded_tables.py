"""Recorded logs in the place of tables of hands and drives."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault

HAND = """extends = "closed-loop-ideal"
duration = 0.5
drop = ["hand"]
[hand]
type = "profile"
interpolation = "hold"
table = {}
"""
LOG = "t,Fx,Fy,Tz\n1000,100,0,0\n1100,200,-50,2\n1300,0,0,0\n"
UNITS = 'units = ["ms", "mN", "mN", "N.mm"]'
DRIVEN = """title = "A mass on a rail, driven by a log"
duration = 1.0
haptics.rate = 100
[linkage]
operational_point = { body = "mass" }
body = [{ name = "mass", mass = 2.0, inertia = 1e-3 }]
[[linkage.joint]]
name = "rail"
type = "prismatic"
axis = 0.0
child = "mass"
drive = { type = "profile", interpolation = "hold", table = { path = "force.csv" } }
"""


def hand(folder, table, log=LOG):
    (folder / "log.csv").write_text(log)
    (folder / "scene.toml").write_text(HAND.format(table))
    return hl.run(folder / "scene.toml", out=folder / "out", figures=False)


@pytest.mark.parametrize("columns", ["", 'columns = ["t", "Fx", "Fy", "Tz"], '])
def test_rows_are_held_in_si_units_from_the_first_time_on(tmp_path, columns):
    found = hand(tmp_path, f'{{ path = "log.csv", {columns}{UNITS} }}')
    t, force = found.haptics["time"], found.haptics["hand.F"]
    rows = np.array([[0.1, 0, 0], [0.2, -0.05, 2e-3], [0, 0, 0]])
    np.testing.assert_allclose(force, rows[np.searchsorted([0.1, 0.3], t, side="right")])


def test_the_hand_of_a_run_is_played_again_to_the_bit(tmp_path):
    arm = {"type": "arm", "target": [[0, 0.0445, 0.0148, -0.788], [0.5, 0.05, 0.03, -0.788]]}
    options = {"duration": 0.5, "hand": arm}
    first = hl.run("closed-loop", options, out=tmp_path / "first", figures=False)
    (tmp_path / "scene.toml").write_text(
        HAND.format('{ path = "first/haptics.csv", columns = ["time", "hand.F"] }').replace(
            "closed-loop-ideal", "closed-loop"
        )
    )
    again = hl.run(tmp_path / "scene.toml", out=tmp_path / "again", figures=False)
    for name in ("hand.F", "haptic_device.x_true", "virtual_mechanism.q"):
        assert np.array_equal(first[name], again[name]), name


def test_a_drive_follows_a_log(tmp_path):
    """F = 3 N for .5 s, then 0: x' = .75 m/s, x = .1875 + .375 m."""
    (tmp_path / "force.csv").write_text("0.0,3.0\n0.5,0.0\n")
    (tmp_path / "scene.toml").write_text(DRIVEN)
    found = hl.run(tmp_path / "scene.toml", out=tmp_path / "out", figures=False)
    assert found["virtual_mechanism.x"][-1, 0] == pytest.approx(0.5625, abs=1e-12)
    assert found["virtual_mechanism.v"][-1, 0] == pytest.approx(0.75, abs=1e-12)


@pytest.mark.parametrize(
    ("table", "log", "said"),
    [
        ('{ path = "log.csv", column = ["t"] }', LOG, "column"),
        ('{ path = "log.csv", columns = ["t", "F"] }', LOG, "column of"),
        ('{ path = "log.csv", units = ["ms", "N"] }', LOG, "2 units for 4 columns"),
        ('{ path = "log.csv", units = ["ms", "N", "lbf", "N.m"] }', LOG, "lbf"),
        ('{ path = "log.csv", units = ["m", "N", "N", "N.m"] }', LOG, "m where a column is in s"),
        (
            '{ path = "log.csv", units = ["s", "deg", "N", "N.m"] }',
            LOG,
            "deg where a column is in N",
        ),
        ('{ path = "log.csv", units = ["s", "N", "N", "N"] }', LOG, "N where a column is in N.m"),
        ('{ path = "log.csv" }', "t,Fx,Fy,Tz\n0,1,2\n", "line 2, column 4: '' is no number"),
        ('{ path = "log.csv" }', "t,Fx,Fy,Tz\n", "it has no rows"),
        ('{ path = "none.csv" }', LOG, "not a regular file"),
        ('{ path = "log.csv", columns = ["t", "Fx", "Fy"] }', LOG, "hand"),
        ('{ path = "log.csv" }', "t,Fx,Fy,Tz\n1,0,0,0\n1,1,0,0\n", "does not come after"),
        ('{ path = "log.csv" }', "t,Fx,Fy,Tz\n1,0,0,0\n2,nan,0,0\n", "finite"),
        ('{ path = "log.csv" }', "t,Fx,Fy,Tz\n1,0,0,0\n1e9999999,0,0,0\n", "line 3, column 1"),
        ('{ path = "log.csv" }', "t,Fx,Fy,Tz\ninf,0,0,0\ninf,0,0,0\n", "line 2, column 1"),
    ],
)
def test_what_no_log_can_be_is_refused_where_it_stands(tmp_path, table, log, said):
    with pytest.raises(InputFault) as fault:
        hand(tmp_path, table, log)
    assert said in str(fault.value)
    assert "hand.table" in str(fault.value)


@pytest.mark.parametrize(("unit", "first"), [("ms", 0), ("ms", 5000), ("us", 1_700_000_000_123)])
def test_a_row_acts_at_its_own_time(tmp_path, unit, first):
    """Of a log with a row each 125 ms, which are 64 ticks."""
    step = {"ms": 125, "us": 125_000}[unit]
    log = "".join(f"{first + step * k},{k},0,0\n" for k in range(4))
    found = hand(tmp_path, f'{{ path = "log.csv", units = ["{unit}", "N", "N", "N.m"] }}', log)
    force, t = found["hand.F"][:, 0], found.haptics["time"]
    np.testing.assert_array_equal(force, np.minimum(np.floor(t / 0.125), 3))
