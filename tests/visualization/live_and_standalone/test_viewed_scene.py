"""The scene that a page shows."""

from __future__ import annotations

from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene


def test_the_mouse_takes_the_place_of_the_hand() -> None:
    scene = load_viewed_scene("two-hands", ["graphics.rate=20"])
    assert scene.hand
    assert scene.hand.type == "spring"
    assert scene.hands["left"].type == "arm"
    assert scene.packaging == "native"
    two = load_viewed_scene("two-users")
    assert two.hands["left"] == two.hand
    assert load_viewed_scene("closed-loop-ideal", ["packaging=python"]).packaging == "python"
