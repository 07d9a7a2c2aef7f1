"""The page of a scene whose device is a board."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hapticlink as hl
from hapticlink.api.runs import with_board
from hapticlink.orchestrator.boards import DRIVERS
from hapticlink.orchestrator.boards.simulated_board import Firmware
from hapticlink.orchestrator.scene.overrides import write_options
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.session import LiveSession
from tests.orchestrator.boards.kits import Port, Still, kit


class Link:
    """A page that pulls at the handle, and is gone after some frames."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []
        self.alive = True

    def send(self, message: dict[str, Any], frame: bool = False) -> None:
        self.sent.append(message)
        self.alive = sum(m["type"] == "frame" for m in self.sent) < 5

    def received(self) -> list[messages.Message]:
        return [messages.Hand("", (0.1, 0.1))]


@pytest.fixture
def port(monkeypatch) -> Iterator[Port]:
    there = Port(Firmware(Still(), limit=0.5))
    monkeypatch.setitem(DRIVERS, "open-kit", kit(there))
    yield there
    there.close()


def test_it_shows_the_measured_handle_and_the_mouse_pulls_at_nothing(port, tmp_path):
    scene = load_viewed_scene("closed-loop", write_options(with_board("/dev/kit")))
    link = Link()
    with pytest.raises(hl.Fault, match="the page's server has ended"):
        LiveSession(scene, link, tmp_path / "view", hl.RealTime).run()
    frames = [m for m in link.sent if m["type"] == "frame"]
    assert all(f["handle"] == f["measured"] for f in frames)
    assert all("F_hand" not in f for f in frames)
    assert not [m for m in link.sent if m["type"] == "refused"]
    (about,) = (m for m in link.sent if m["type"] == "scene")
    assert about["boards"]  # so that nobody is asked to drag, or told of the hand's energy
    (controls, *_) = (m["controls"] for m in link.sent if m["type"] == "controls")
    keys = {control["key"] for control in controls}
    assert "graphics.rate" in keys
    assert "speed" not in keys  # the time of a board is the clock's
    assert not any(port.torques[-1])
