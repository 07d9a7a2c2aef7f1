"""Two users on one linkage: two windows, each with hold of one handle."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.visualization.browser_code.chromium import Page
from tests.visualization.browser_code.served_page import Served

SERVED = "two-users"


def place(frame: dict[str, Any], user: str, port: str) -> np.ndarray:
    return np.array((frame["others"][user] if user else frame)[port])


def test_each_window_pulls_a_handle_and_both_feel_the_other(served: Served) -> None:
    """The second user holds on where the point is; a pull at the first one is felt there, and the
    point yields less than with nobody there."""
    moved = {}
    for holds_on in (False, True):
        with served.window() as first, served.window() as second:
            first.until(lambda new: new["frame"]["t"] > 0.3)
            first.send(type="time", do="reset")
            start = first.until(lambda new: "state" in new and new["frame"]["t"] < 0.2)["frame"]
            if holds_on:
                second.send(type="hand", at=list(place(start, "left", "x")[:2]), user="left")
            x = place(start, "", "x")
            first.send(type="hand", at=[x[0] - 0.02, x[1] + 0.01])
            end = first.until(lambda new, t=start["t"]: new["frame"]["t"] > t + 2.0)["frame"]
            moved[holds_on] = np.linalg.norm((place(end, "", "x") - x)[:2])
            for user in ("", "left"):
                force = np.linalg.norm(place(end, user, "F_hand")[:2])
                assert force > 0.3 if holds_on else force < 0.05
            for user in ("", "left"):
                off = place(end, user, "x") - place(end, user, "handle")
                assert np.linalg.norm(off[:2]) < 1e-3
    assert moved[True] < 0.95 * moved[False]


def test_a_handle_has_one_hand_and_a_closed_window_lets_go(served: Served) -> None:
    with served.window() as watching:
        watching.until(lambda new: new["frame"]["t"] > 0.3)
        with served.window() as first:
            x = place(first.until(lambda new: True)["frame"], "left", "x")
            first.send(type="hand", at=[x[0] + 0.02, x[1]], user="left")
            pulled = "F_hand"
            watching.until(lambda new: np.hypot(*place(new["frame"], "left", pulled)[:2]) > 0.3)
            watching.send(type="hand", at=[x[0], x[1]], user="left")
            watching.until(lambda new: "another window" in new.get("refused", {}).get("why", ""))
            watching.send(type="hand", at=[x[0], x[1]], user="right")
            watching.until(lambda new: "no 'right'" in new.get("refused", {}).get("why", ""))
        watching.until(lambda new: np.hypot(*place(new["frame"], "left", pulled)[:2]) < 1e-2)


def test_in_two_browser_windows_the_nearest_handle_is_pulled(
    served: Served, window: Callable[..., Page]
) -> None:
    pages = {"": window(served.url), "left": window(served.url)}
    places = {"": "view.frame.handle", "left": "view.frame.others.left.handle"}
    pages[""].get("document.getElementById('pause').click()")
    pages["left"].until("view.state.paused")
    for user, page in pages.items():
        x, y = page.get(
            f"(() => {{ const box = view.stage.canvas.getBoundingClientRect();"
            f" const [x, y] = view.stage.toScreen({places[user]});"
            " return [box.left + x, box.top + y]; })()"
        )
        page.page.mouse.move(x, y)
        page.page.mouse.down()
        page.page.mouse.move(x + (-120 if user else 120), y, steps=5)
        assert page.get("[...view.stage.pulls.values()].map((p) => p.user)") == [user]
    pages[""].get("document.getElementById('pause').click()")
    for page in pages.values():
        force = "Math.hypot(...{}.F_hand.slice(0, 2)) > 0.2"
        page.until(force.format("view.frame"))
        page.until(force.format("view.frame.others.left"))
    captions = "[...document.querySelectorAll('figcaption')].map((c) => c.innerText).join()"
    assert "left: error" in pages["left"].get(captions)
    pages[""].page.close()
    pages["left"].until("Math.hypot(...view.frame.F_hand.slice(0, 2)) < 0.05")
    assert pages["left"].get("view.stage.pulls.size") == 1
