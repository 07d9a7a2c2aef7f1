"""The page of a linkage in space in Chromium: its view is turned, and the mouse pulls in the view's
plane."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.visualization.browser_code.chromium import Page
from tests.visualization.browser_code.served_page import Served

Window = Callable[..., Page]
SERVED_TEXT = """
title = "A body that floats"
haptics.rate = 64
duration = 1.0

[linkage]
operational_point = { body = "body" }

[[linkage.body]]
name = "body"
mass = 0.3
inertia = [0.001, 0.002, 0.002]
center = [0.0, 0.0, 0.0]

[[linkage.joint]]
name = "joint"
type = "floating"
child = "body"

[hand]
type = "constant"
wrench = [0.0, 0.0, 0.0]
"""
"""Its motion has all directions, and none is another's."""


def test_a_drag_pulls_in_the_plane_of_the_view(served: Served, window: Window) -> None:
    page = window(served.url)
    assert page.page.inner_text("#door").startswith(
        "Drag the handle (circle); drag beside it to turn the view."
    )
    start, rows = (np.array(page.get(f"view.{of}")) for of in ("frame.x", "stage.view.rows"))
    page.pull(0.03, 0.02)
    wanted = start + 0.03 * rows[0] + 0.02 * rows[1]
    page.until(f"view.frame.x.every((v, i) => Math.abs(v - {wanted.tolist()}[i]) < 2e-3)")
    page.page.mouse.up()
    page.until("Math.hypot(...view.frame.F_hand) < 0.1")


def test_a_drag_beside_the_handle_turns_the_view_about_the_body(
    served: Served, window: Window
) -> None:
    page = window(served.url)
    page.until("view.stage.limits")
    box = page.page.locator("#scene").bounding_box()
    seen, middle = "view.stage.toScreen(view.frame.poses.body)", page.get("view.frame.x")
    before, rows = (np.array(page.get(of)) for of in (seen, "view.stage.view.rows"))
    page.page.mouse.move(box["x"] + 30, box["y"] + 30)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + 80, box["y"] + 50, steps=5)
    page.page.mouse.up()
    assert page.get("view.stage.pulls.size") == 0
    found = np.array(page.get("view.stage.view.rows"))
    assert found @ found.T == pytest.approx(np.eye(3))
    assert found[0] @ rows[0] == pytest.approx(np.cos(0.01 * 50))  # a hundredth of a radian to a px
    assert found[1, 2] == pytest.approx(np.cos(0.35 + 0.01 * 20))
    page.until("view.stage.scale")
    assert page.get(seen) == pytest.approx(before, abs=1.0)
    assert page.get("view.frame.x") == pytest.approx(middle, abs=1e-3)
    page.page.keyboard.press("Shift+ArrowLeft")
    page.until(f"Math.abs(view.stage.view.turned - ({-0.6 - 0.5 + 0.1})) < 1e-9")
