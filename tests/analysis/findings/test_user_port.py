"""Energy at the user's port: what the mechanism gained beyond what the hands did."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.user_port import UserPort, allowance, user_port
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.figures.run_figures import figures


@cache
def account(scene: str, *options: str) -> tuple[Results, UserPort | None]:
    """A run in memory and the energy at its user's port."""
    with temporary_folders.temporary_folder() as folder:
        results = simulate(scene, folder, options, csv=False).results
    return results, user_port(results)


def with_port(scene: str, *options: str) -> tuple[Results, UserPort]:
    """As `account`, of a run that has one."""
    results, port = account(scene, *options)
    assert port
    return results, port


SECOND = (
    "linkage.point=[{name='left', body='link4', at=[0.02, 0.0]}]",
    "hands.left={wrench=[0.1, 0.0, 0.0]}",
)


SCENES = [
    ("closed-loop-ideal", ()),
    ("closed-loop-ideal", SECOND),
    ("closed-loop-ideal", ("coupling=jacobi",)),
    ("closed-loop-ideal", ("sensing=encoders", "controller.bias=full")),
    ("closed-loop-ideal", ("controller.topology=false", "controller.teleoperation=false")),
    ("closed-loop-direct", ()),
    ("closed-loop-direct", ("hold=foh", "graphics.rate=60")),
    ("closed-loop-direct", ("graphics.rate={min=20,max=40,seed=3}",)),
    ("enclosure", ()),
    ("two-users", ()),
    ("two-users", ("graphics.rate=20", "sensing=encoders", "controllers.left.topology=false")),
    ("serial", ("controller.damping=[1.0,1.0,0.01]",)),
]


def test_what_is_tolerated_is_said_in_words() -> None:
    assert allowance(0.11) == "27.5 mJ, a quarter of the 110 mJ that the hand gave and took back"
    assert allowance(0.003) == "1 mJ, the least that a hand notices"


@pytest.mark.parametrize(("scene", "options"), SCENES)
def test_its_blocks_are_all_of_it(scene: str, options: tuple[str, ...]) -> None:
    """The blocks add up to the port at every sample, which is found from energy and works alone;
    what the mechanism loses is its energy less the meters' works, and without friction, contacts
    and drives, run at the ticks, nothing."""
    results, port = with_port(scene, "duration=1.0", *options)
    total = sum(port.blocks_J.values())
    assert np.abs(total - port.generated_J).max() < 1e-15 + 1e-13 * np.abs(port.generated_J).max()
    fewer = user_port(results, works_too=False)
    assert fewer
    assert replace(fewer.measured, works=port.works, hand_work=port.hand_work_J) == port.measured
    meters = results.record.meters
    if port.time_s[-1] == results.record.end.time:
        on_handle = meters["hand.F -> haptic_device.F_hand"].held
        assert port.works["hand"] == pytest.approx(on_handle)
    energy = next(t["virtual_mechanism.energy"] for t in results.tables.values()
                  if "virtual_mechanism.energy" in t)  # fmt: skip
    into = sum(e.held for n, e in meters.items() if "-> virtual_mechanism." in n)
    lost = port.measured.blocks["mechanism"].generated
    assert lost == pytest.approx(energy[-1] - energy[0] - into, abs=1e-6)
    if scene == "closed-loop-ideal":
        assert abs(lost) < 1e-6


LATE = [
    ("two-users", ("coupling=jacobi",), 1),
    ("two-users", ('delays."hand.F"=0.01', 'delays."hand_left.F"=0.01'), 6),
]


@pytest.mark.parametrize(("scene", "options", "ticks"), LATE)
def test_a_force_that_comes_late_counts_where_it_acts(
    scene: str, options: tuple[str, ...], ticks: int
) -> None:
    """By a latency, or in the order of Jacobi, a force acts `ticks` after its stamp: paired with
    the displacements there, at every sample (the first one acts until the second arrives)."""
    results, port = with_port(scene, "duration=0.5", *options)
    table = results.haptics
    work = np.zeros(len(table["time"]))
    for hand, handle in (("hand", "haptic_device"), ("hand_left", "haptic_device_left")):
        force = table[f"{hand}.F"]
        acts = np.concatenate([np.repeat(force[:1], ticks, axis=0), force])[: len(force) - 1]
        work[1:] += (acts * np.diff(table[f"{handle}.x_true"], axis=0)).sum(axis=1).cumsum()
    energy = table["virtual_mechanism.energy"]
    expected = energy - energy[0] - work
    np.testing.assert_allclose(port.generated_J, expected, atol=1e-9 * np.abs(work).max())


@pytest.mark.parametrize("link", [{"loss": 0.3}, {"max": 0.02}, {"max": 0.02, "loss": 0.3}])
def test_a_force_that_is_lost_or_overtaken_does_not_act(link: dict[str, float]) -> None:
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
    results, port = with_port("closed-loop-ideal", *options)
    table = results.haptics
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


@pytest.mark.parametrize(
    ("options", "goes_on"),
    [(("duration=0.5", "phases.hand=1/1024"), False), (("duration=0.6", "graphics.rate=60"), True)],
)
def test_a_meter_that_ends_beside_the_last_frame(options: tuple[str, ...], goes_on: bool) -> None:
    """A hand half a tick beside the others, whatever the energy between the frames before; and a
    meter with ticks after that frame: its work until then is that of its constant wrench."""
    results, port = with_port("closed-loop-direct", *options, "hand.wrench=[-0.5, 0.0, 0.0]")
    frames, ticks = results.graphics, results.haptics
    until = results.record.meters["hand.F -> haptic_device.F_hand"].until
    assert (until > port.time_s[-1] + 0.01) == goes_on
    x = np.interp(frames["time"], ticks["time"], ticks["haptic_device.x_true"][:, 0])
    energy = frames["virtual_mechanism.energy"]
    np.testing.assert_allclose(port.generated_J, energy - energy[0] + 0.5 * (x - x[0]), atol=1e-12)


def test_a_run_that_ends_beside_a_frame() -> None:
    """Meters stop at the newest sample of the source that the mechanism has stepped past, the
    account at the newest one of the mechanism, 2 ms later: the mechanism's loss is still its energy
    less the work of what it held from frame to frame."""
    results, port = with_port("closed-loop-direct", "duration=0.95")
    frames, ticks = results.graphics, results.haptics
    assert port.time_s[-1] > results.record.meters["hand.F -> virtual_mechanism.F_hand"].until
    rows = np.searchsorted(ticks["time"], frames["time"][:-1] + 1e-12, "right") - 1
    acts = (ticks["hand.F"] - ticks["controller.F_drift"])[rows]
    work = (acts * np.diff(frames["virtual_mechanism.x"], axis=0)).sum()
    energy = frames["virtual_mechanism.energy"]
    lost = port.blocks_J["mechanism"][-1]
    assert lost == pytest.approx(energy[-1] - energy[0] - work, abs=1e-9)


def test_a_hold_of_its_drift_force_is_that_of_the_meter() -> None:
    results, port = with_port("closed-loop-direct", "duration=1.0")
    blocks = port.measured.blocks
    name = "controller.F_drift -> virtual_mechanism.F_drift"
    hold = blocks["hold of controller.F_drift on the mechanism"].generated
    assert hold == pytest.approx(results.record.across[name].generated, abs=1e-12)
    assert hold == pytest.approx(max(block.generated for block in blocks.values()))


def test_all_blocks_vanish_with_the_step() -> None:
    """At one rate, with all velocity terms, every block vanishes with the step."""
    generated = []
    for rate in (512, 4096):
        options = [f"haptics.rate={rate}", f"graphics.rate={rate}", "controller.bias=full"]
        _, port = with_port("closed-loop-ideal", *options)
        generated.append(sum(abs(b.generated) for b in port.measured.blocks.values()))
    coarse, fine = generated
    assert fine < coarse / 4


def test_a_held_mobility_modulates_power() -> None:
    """No force crosses a rate, and yet the frames' rate decides what the motors give: less at each
    higher rate, to nothing where the frames are the ticks."""
    works = []
    for rate in (10, 30, 60, 512):
        options = [f"graphics.rate={rate}", "mechanism.directions=true", "controller.bias=full"]
        _, port = with_port("closed-loop-ideal", *options)
        works.append(port.works["held mobility"])
    assert np.all(np.diff(works) < 0.0)
    assert works[0] > 4e-3
    assert works[-1] < 0.2 * works[2]


def test_contacts_have_an_account_on_both_sides() -> None:
    """Walls take energy; the handle, a little elsewhere, gives up nearly the same."""
    _, port = with_port("enclosure", "graphics.rate=60")
    handle, mechanism = (port.works[name] for name in ("F_env", "F_env on the mechanism"))
    assert mechanism < -1e-3
    assert handle == pytest.approx(mechanism, rel=0.1)


def test_without_a_handle_there_is_none() -> None:
    assert account("five-bar", "duration=0.01")[1] is None


LACKING = [
    (["virtual_mechanism", "hand.F", "haptic_device"], False),
    (["virtual_mechanism", "hand", "haptic_device", "controller", "hand_left"], False),
    (["virtual_mechanism", "hand", "haptic_device", "hand_left", "haptic_device_left"], True),
]


def test_a_handle_that_something_else_pushes_has_none() -> None:
    """The work on it is not that of `hand.F`."""
    other = "connection=[{from='hand_left.F', to='haptic_device.F_hand'}]"
    results, port = account("closed-loop-ideal", "duration=0.1", *SECOND, other)
    assert port is None
    notes = [line for line in summary.lines(results) if "no energy at the user's port" in line]
    assert "hand_left.F -> haptic_device.F_hand" in notes[0]


@pytest.mark.parametrize(("signals", "has_port"), LACKING)
def test_what_is_not_recorded_is_nobodys_energy(signals: list[str], has_port: bool) -> None:
    """Without another hand's work there is no energy at the port, which would be the work's size;
    without a block's wrench no block, since others would have its energy."""
    results, port = account("two-users", "duration=0.2", f"record.signals={signals}")
    assert bool(port) == has_port
    if port:
        _, whole = with_port("two-users", "duration=0.2")
        np.testing.assert_array_equal(port.generated_J, whole.generated_J)
        assert whole.blocks_J
        assert not port.blocks_J
        figures(results)["user_port"]
