"""Energy at the user's port: what the mechanism gained beyond what the hands did."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.results.user_port import user_port

SECOND = (
    "linkage.point=[{name='left', body='link4', at=[0.02, 0.0]}]",
    "hands.left={wrench=[0.1, 0.0, 0.0]}",
)


@pytest.mark.parametrize("options", [(), SECOND, ("coupling=jacobi",)])
def test_its_parts_are_the_meters(tmp_path: Path, options: tuple[str, ...]) -> None:
    """The hand's work is that of the meter on the handle, and nothing else than forces at its
    points works on a mechanism without friction and drives."""
    found = simulate("closed-loop", tmp_path, ["duration=1.0", *options]).results
    port = user_port(found)
    assert port
    booked = found.run["energies_within_a_rate"]
    assert port.works["hand"] == pytest.approx(booked["hand.F -> haptic_device.F_hand"]["held"])
    assert port.generated_J[-1] == pytest.approx(sum(port.parts.values()), abs=1e-12)
    assert abs(port.parts["mechanism"]) < 1e-6
    assert port.told["peak"] == port.generated_J.max() > 1e-4


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
