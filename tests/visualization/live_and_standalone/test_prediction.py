"""The stability verdict on the page is that of `stability`; its process leaves nothing behind."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticlink.components.port_space import PLANE
from hapticlink.visualization.live_and_standalone.offered_controls import JITTER, RATE, Settings
from hapticlink.visualization.live_and_standalone.prediction import predict_stability
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene, mouse
from tests.analysis.stability.own_hand import own_hand
from tests.visualization.browser_code.chromium import Page, chromium
from tests.visualization.browser_code.served_page import Served, values

SCENE, OPTIONS = "closed-loop-direct", ("graphics.rate=12.8",)
HELD = {"x": "x_S", "v": "v_S", "Lambda_inv": "Lambda_inv", "P_c": "P_c"}
"""What the mechanism sends to the controller."""
QUICK = 120.0
"""Time (s) within which a verdict is computed even beside other tests."""


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Served]:
    with Served(tmp_path, *(f"--set={option}" for option in OPTIONS), scene=SCENE) as served:
        yield served


def test_the_light_turns_red_before_anyone_drags(page: Served) -> None:
    """At 12.8 Hz the mouse holds a stable loop with zero-order holds, and an unstable one with
    first-order ones, by the growth of its equilibrium. Time stands still meanwhile."""
    with chromium() as browser:
        window = Page(browser, page.url)
        window.page.click("#pause")
        window.page.wait_for_function("view.map?.verdict", timeout=1e3 * QUICK)
        before = window.get("view.map.why")
        for port, target in HELD.items():
            name = f"holds.virtual_mechanism.{port} -> controller.{target}"
            window.get(
                "document.querySelectorAll('details').forEach((each) => { each.open = true; })"
            )
            window.page.select_option(f'[data-control="{name}"]', "foh")
        window.until("view.map.said === 'computing'")
        window.page.wait_for_function("view.map.verdict === 'unstable'", timeout=1e3 * QUICK)
        assert window.page.get_attribute("#verdict", "class") == "light red"
        assert window.get("view.energy") != "red"
        told, handle = window.get("view.map.why"), window.get("view.frame.handle")
        assert window.faults == []
    held = {"hand.stiffness": [100.0, 100.0, 0.0], "hand.target": [[0.0, *handle]]}
    for text, hold, verdict in ((before, "zoh", "stable"), (told, "foh", "unstable")):
        options = held | {"hold": hold, "duration": 3.0}
        found = own_hand(load_viewed_scene(SCENE, OPTIONS), options)
        mouse = text.partition("\n")[0]
        assert mouse.startswith(f"the mouse: {verdict}, growth rate ")
        growth = float(mouse.partition("growth rate ")[2].partition(" ")[0])
        assert found.verdict == verdict
        assert growth == pytest.approx(found.growth, rel=1e-3)


@pytest.mark.parametrize(
    ("settings", "said"),
    [({RATE: 30.1}, "30.1 Hz repeats only after 5120 ticks, 30 Hz would be fast"),
     ({JITTER: 0.1}, "with jitter the system never repeats")],
)  # fmt: skip
def test_what_would_take_long_is_refused(settings: Settings, said: str) -> None:
    found = predict_stability(load_viewed_scene(SCENE, OPTIONS), settings, {})
    assert (found["verdict"], found["said"]) == ("", f"not computed: {said}")


def test_a_verdict_says_that_it_is_without_the_friction_of_a_hold() -> None:
    settings: Settings = {RATE: 64.0}
    beside = ", without the friction of hold passive"
    assert beside not in predict_stability(load_viewed_scene(SCENE), settings, {})["said"]
    settings["holds.controller.F_drift -> virtual_mechanism.F_drift"] = "passive"
    assert predict_stability(load_viewed_scene(SCENE), settings, {})["said"].endswith(beside)


def test_a_hand_that_is_unstable_elsewhere_than_at_the_mouse_is_said_to() -> None:
    """At its own 30 Hz a firm grip shakes closed-loop-direct and the mouse does not: one line says
    both, lest what is seen contradicts the light. At 64 Hz there is nothing to add."""
    beside = "; stable in the mouse's hand"
    shaken = predict_stability(load_viewed_scene(SCENE), {}, {})
    assert (shaken["verdict"], shaken["mouse"]) == ("unstable", "stable")
    assert shaken["said"].endswith(f", in firm grip{beside}")
    calm = predict_stability(load_viewed_scene(SCENE), {RATE: 64.0}, {})
    assert (calm["verdict"], calm["mouse"]) == ("stable", "stable")
    assert beside not in calm["said"]


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are seen in /proc alone")
def test_a_newer_question_ends_what_is_computed(page: Served) -> None:
    """Once the new rate is shown, every verdict is on it, and one process computes all."""
    with page.window() as window:
        window.until(lambda new: "controls" in new)
        window.set("graphics.rate", 31)
        server = _children(page.process.pid, "live_page.server")[0]
        (computing,) = _until(lambda: _children(server, "live_page.stability_process"))
        window.until(lambda new: values(new["controls"])["graphics.rate"] == 31)
        window.set("graphics.rate", 12.8)
        window.until(lambda new: values(new["controls"])["graphics.rate"] == 12.8)
        window.newest.pop("map", None)
        found = window.until(lambda new: new.get("map", {}).get("verdict"), QUICK)["map"]
        assert _children(server, "live_page.stability_process") == [computing]
        handle = window.until(lambda new: True)["frame"]["handle"]
    parameters = {"hand.stiffness": [*mouse(PLANE)[0]], "hand.target": handle}
    why = predict_stability(load_viewed_scene(SCENE, OPTIONS), {}, parameters)["why"]
    assert found["why"].startswith(why.partition("\n")[0])


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are seen in /proc alone")
@pytest.mark.parametrize("end", ["ctrl-c", "server", "loop"])
def test_nothing_is_left_of_a_map_that_nobody_waits_for(page: Served, end: str) -> None:
    with page.window() as window:
        window.until(lambda new: "controls" in new)
        window.set("graphics.rate", 31)  # takes long
        server = _children(page.process.pid, "live_page.server")[0]
        computing = _until(lambda: _children(server, "live_page.stability_process"))
        match end:
            case "ctrl-c":
                assert page.end()[0] == 0
            case "server":
                os.kill(server, signal.SIGKILL)
            case "loop":
                page.process.kill()
        _until(lambda: not any(Path(f"/proc/{process}").exists() for process in computing))


def _children(process: int, module: str) -> list[int]:
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return [int(c) for c in children if module in Path(f"/proc/{c}/cmdline").read_text()]


def _until(holds: Callable[[], Any]) -> Any:
    end = time.monotonic() + QUICK
    while not (found := holds()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return found
