"""The scene that a page shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene


def test_a_scene_without_a_mechanism_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "device.toml"
    path.write_text('title = "A device"\nduration = 1.0\n[device]\n')
    with pytest.raises(InputFault, match=r"device.toml: has no \[linkage\].*closed-loop"):
        load_viewed_scene(str(path))


def test_the_mouse_takes_the_place_of_the_hand() -> None:
    scene = load_viewed_scene("two-hands", ["graphics.rate=20"])
    assert scene.hand
    assert scene.hand.type == "spring"
    assert scene.hands["left"].type == "arm"
    assert scene.packaging == "native"
    two = load_viewed_scene("two-users")
    assert two.hands["left"] == two.hand
    assert load_viewed_scene("closed-loop", ["packaging=python"]).packaging == "python"
