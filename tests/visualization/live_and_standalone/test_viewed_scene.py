"""The scene that a page shows."""

from __future__ import annotations

from hapticlink.visualization.live_and_standalone.viewed_scene import viewed


def test_the_mouse_takes_the_place_of_the_hand() -> None:
    scene = viewed("two-hands", ["graphics.rate=20"])
    assert scene.hand
    assert scene.hand.type == "spring"
    assert scene.hands["left"].type == "arm"
    assert scene.packaging == "native"
    two = viewed("two-users")
    assert two.hands["left"] == two.hand
    assert viewed("closed-loop", ["packaging=python"]).packaging == "python"
