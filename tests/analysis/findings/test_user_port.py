"""Energy at the user's port: what the mechanism gained beyond what the hands did."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.tables import Results
from hapticlink.visualization.figures.run_figures import figures

SECOND = (
    "linkage.point=[{name='left', body='link4', at=[0.02, 0.0]}]",
    "hands.left={wrench=[0.1, 0.0, 0.0]}",
)


SCENES = [
    ("closed-loop", ()),
    ("closed-loop", SECOND),
    ("closed-loop", ("coupling=jacobi",)),
    ("closed-loop", ("sensing=encoders", "controller.bias=full")),
    ("closed-loop", ("controller.topology=false", "controller.teleoperation=false")),
    ("closed-loop-direct", ()),
    ("closed-loop-direct", ("hold=foh", "graphics.rate=60")),
    ("closed-loop-direct", ("graphics.rate={min=20,max=40,seed=3}",)),
    ("enclosure", ()),
    ("two-users", ()),
    ("two-users", ("graphics.rate=20", "sensing=encoders", "controllers.left.topology=false")),
    ("serial", ("controller.damping=[1.0,1.0,0.01]",)),
]


@pytest.mark.parametrize(("scene", "options"), SCENES)
def test_its_blocks_are_all_of_it(tmp_path: Path, scene: str, options: tuple[str, ...]) -> None:
    """The blocks add up to the port at every sample, which is found from energy and works alone;
    what the mechanism loses is its energy less the meters' works, and without friction, contacts
    and drives, run at the ticks, nothing."""
    results = simulate(scene, tmp_path, ["duration=1.0", *options]).results
    port = user_port(results)
    assert port
    total = sum(port.blocks_J.values())
    assert np.abs(total - port.generated_J).max() < 1e-15 + 1e-13 * np.abs(port.generated_J).max()
    across = results.run["energies"]
    booked = ({} if across == "none" else across) | results.run["energies_within_a_rate"]
    if port.time_s[-1] == results.run["end"]["time"]:
        on_handle = booked["hand.F -> haptic_device.F_hand"]["held"]
        assert port.works["hand"] == pytest.approx(on_handle)
    energy = next(t["virtual_mechanism.energy"] for t in results.tables.values()
                  if "virtual_mechanism.energy" in t)  # fmt: skip
    into = sum(e["held"] for n, e in booked.items() if "-> virtual_mechanism." in n)
    lost = port.told["blocks"]["mechanism"]["generated"]
    assert lost == pytest.approx(energy[-1] - energy[0] - into, abs=1e-6)
    if scene == "closed-loop":
        assert abs(lost) < 1e-6


LATE = [
    ("two-users", ("coupling=jacobi",), 1),
    ("two-users", ('delays."hand.F"=0.01', 'delays."hand_left.F"=0.01'), 6),
]


@pytest.mark.parametrize(("scene", "options", "ticks"), LATE)
def test_a_force_that_comes_late_counts_where_it_acts(
    tmp_path: Path, scene: str, options: tuple[str, ...], ticks: int
) -> None:
    """By a latency, or in the order of Jacobi, a force acts `ticks` after its stamp: paired with
    the displacements there, at every sample (the first one acts until the second arrives)."""
    found = simulate(scene, tmp_path, ["duration=0.5", *options]).results
    port, table = user_port(found), found.haptics
    assert port
    work = np.zeros(len(table["time"]))
    for hand, handle in (("hand", "haptic_device"), ("hand_left", "haptic_device_left")):
        force = table[f"{hand}.F"]
        acts = np.concatenate([np.repeat(force[:1], ticks, axis=0), force])[: len(force) - 1]
        work[1:] += (acts * np.diff(table[f"{handle}.x_true"], axis=0)).sum(axis=1).cumsum()
    energy = table["virtual_mechanism.energy"]
    expected = energy - energy[0] - work
    np.testing.assert_allclose(port.generated_J, expected, atol=1e-9 * np.abs(work).max())


@pytest.mark.parametrize("link", [{"loss": 0.3}, {"max": 0.02}, {"max": 0.02, "loss": 0.3}])
def test_a_force_that_is_lost_or_overtaken_does_not_act(
    tmp_path: Path, link: dict[str, float]
) -> None:
    """The newest force that has arrived acts, each with a latency and a luck drawn by PCG64 (that
    of t = 0 is known, and sent again by a sampled hand)."""
    rows = [[t / 10, *np.cos([9 * t, 7 * t, 5 * t]) * (0.6, 0.6, 0.01)] for t in range(11)]
    options = [
        "duration=1.0",
        f"hand={{type='profile', table={[[float(v) for v in row] for row in rows]}}}",
        *(
            f"delays.haptic_device.F_hand.{key}={value}"
            for key, value in (link | {"seed": 2}).items()
        ),
    ]
    found = simulate("closed-loop", tmp_path, options).results
    port, table = user_port(found), found.haptics
    assert port
    force, x = table["hand.F"], table["haptic_device.x_true"]
    drawn = np.random.Generator(np.random.PCG64(2)).random((len(force), 2))[1:]
    late = np.ceil(drawn[:, 0] * link.get("max", 0.0) * 512 - 1e-9)
    late[drawn[:, 1] < link.get("loss", 0.0)] = np.inf
    arrival = np.arange(len(force)) + np.concatenate([[0.0], late])
    acts = [force[np.flatnonzero(arrival[: k + 1] <= k)[-1]] for k in range(len(force) - 1)]
    work = np.concatenate([[0.0], (acts * np.diff(x, axis=0)).sum(axis=1).cumsum()])
    energy = table["virtual_mechanism.energy"]
    expected = energy - energy[0] - work
    np.testing.assert_allclose(port.generated_J, expected, atol=1e-9 * np.abs(work).max())


def test_a_meter_that_stops_between_two_frames(tmp_path: Path) -> None:
    """A hand half a tick beside the others: its work until the last frame is that of its samples,
    whatever the energy between the frames before."""
    options = ["duration=0.5", "phases.hand=1/1024", "hand.wrench=[-0.5, 0.0, 0.0]"]
    found = simulate("closed-loop-direct", tmp_path, options).results
    port, frames, ticks = user_port(found), found.graphics, found.haptics
    assert port
    x = np.interp(frames["time"], ticks["time"], ticks["haptic_device.x_true"][:, 0])
    energy = frames["virtual_mechanism.energy"]
    np.testing.assert_allclose(port.generated_J, energy - energy[0] + 0.5 * (x - x[0]), atol=1e-12)


def test_a_run_that_ends_beside_a_frame(tmp_path: Path) -> None:
    """Meters stop at the newest sample of the source that the mechanism has stepped past, the
    account at the newest one of the mechanism, 2 ms later: the mechanism's loss is still its energy
    less the work of what it held from frame to frame."""
    found = simulate("closed-loop-direct", tmp_path, ["duration=0.95"]).results
    port, frames, ticks = user_port(found), found.graphics, found.haptics
    assert port
    assert port.time_s[-1] > found.run["energies"]["hand.F -> virtual_mechanism.F_hand"]["until"]
    rows = np.searchsorted(ticks["time"], frames["time"][:-1] + 1e-12, "right") - 1
    acts = (ticks["hand.F"] - ticks["controller.F_drift"])[rows]
    work = (acts * np.diff(frames["virtual_mechanism.x"], axis=0)).sum()
    energy = frames["virtual_mechanism.energy"]
    lost = port.blocks_J["mechanism"][-1]
    assert lost == pytest.approx(energy[-1] - energy[0] - work, abs=1e-9)


def test_a_meter_that_goes_on_after_the_last_frame(tmp_path: Path) -> None:
    """The hand's work until the mechanism's last frame is that of its constant wrench until then,
    without that of the ticks after it, which the meter has."""
    options = ["duration=0.6", "graphics.rate=60", "hand.wrench=[-0.5, 0.0, 0.0]"]
    found = simulate("closed-loop-direct", tmp_path, options).results
    port, frames, ticks = user_port(found), found.graphics, found.haptics
    assert port
    assert found.run["energies_within_a_rate"]["hand.F -> haptic_device.F_hand"]["until"] > (
        port.time_s[-1] + 0.01
    )
    x = np.interp(frames["time"], ticks["time"], ticks["haptic_device.x_true"][:, 0])
    energy = frames["virtual_mechanism.energy"]
    np.testing.assert_allclose(port.generated_J, energy - energy[0] + 0.5 * (x - x[0]), atol=1e-12)


def test_a_hold_of_its_drift_force_is_that_of_the_meter(tmp_path: Path) -> None:
    results = simulate("closed-loop-direct", tmp_path, ["duration=1.0"]).results
    port = user_port(results)
    assert port
    name = "controller.F_drift -> virtual_mechanism.F_drift"
    hold = port.told["blocks"]["hold of controller.F_drift on the mechanism"]["generated"]
    assert hold == pytest.approx(results.run["energies"][name]["generated"], abs=1e-12)
    assert hold == pytest.approx(max(b["generated"] for b in port.told["blocks"].values()))


def test_all_blocks_vanish_with_the_step(tmp_path: Path) -> None:
    """At one rate, with all velocity terms, every block vanishes with the step."""
    found = []
    for rate in (512, 4096):
        options = [f"haptics.rate={rate}", f"graphics.rate={rate}", "controller.bias=full"]
        port = user_port(simulate("closed-loop", tmp_path / str(rate), options).results)
        assert port
        found.append({n: abs(b["generated"]) for n, b in port.told["blocks"].items()})
    coarse, fine = found
    assert sum(fine.values()) < sum(coarse.values()) / 4


def test_a_held_mobility_modulates_power(tmp_path: Path) -> None:
    """No force crosses a rate, and yet the frames' rate decides what the motors give: less at each
    higher rate, to nothing where the frames are the ticks."""
    works = []
    for rate in (10, 30, 60, 512):
        options = [f"graphics.rate={rate}", "mechanism.directions=true", "controller.bias=full"]
        found = simulate("closed-loop", tmp_path / str(rate), options).results
        port = user_port(found)
        assert port
        works.append(port.works["held mobility"])
    assert np.all(np.diff(works) < 0.0)
    assert works[0] > 4e-3
    assert works[-1] < 0.2 * works[2]


def test_contacts_have_an_account_on_both_sides(tmp_path: Path) -> None:
    """Walls take energy; the handle, a little elsewhere, gives up nearly the same."""
    port = user_port(simulate("enclosure", tmp_path, ["graphics.rate=60"]).results)
    assert port
    handle, mechanism = (port.works[name] for name in ("F_env", "F_env on the mechanism"))
    assert mechanism < -1e-3
    assert handle == pytest.approx(mechanism, rel=0.1)


def test_without_a_handle_there_is_none(tmp_path: Path) -> None:
    found: Results = simulate("five-bar", tmp_path, ["duration=0.01"]).results
    assert user_port(found) is None


LACKING = [
    (["virtual_mechanism", "hand.F", "haptic_device"], False),
    (["virtual_mechanism", "hand", "haptic_device", "controller", "hand_left"], False),
    (["virtual_mechanism", "hand", "haptic_device", "hand_left", "haptic_device_left"], True),
]


def test_a_handle_that_something_else_pushes_has_none(tmp_path: Path) -> None:
    """The work on it is not that of `hand.F`."""
    other = "connection=[{from='hand_left.F', to='haptic_device.F_hand'}]"
    results = simulate("closed-loop", tmp_path, ["duration=0.1", *SECOND, other]).results
    assert user_port(results) is None
    told = [line for line in summary.lines(results) if "no energy at the user's port" in line]
    assert "hand_left.F -> haptic_device.F_hand" in told[0]


@pytest.mark.parametrize(("signals", "found"), LACKING)
def test_what_is_not_recorded_is_nobodys_energy(
    tmp_path: Path, signals: list[str], found: bool
) -> None:
    """Without another hand's work there is no energy at the port, which would be the work's size;
    without a block's wrench no block, since others would have its energy."""
    options = ["duration=0.2", f"record.signals={signals}"]
    results = simulate("two-users", tmp_path, options).results
    port = user_port(results)
    assert bool(port) == found
    if port:
        whole = user_port(simulate("two-users", tmp_path, options[:1]).results)
        assert whole
        np.testing.assert_array_equal(port.generated_J, whole.generated_J)
        assert whole.blocks_J
        assert not port.blocks_J
        figures(results)["user_port"]
