"""Two runs under one mouse on the served page: the second is a session of its own."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.visualization.browser_code.chromium import Page, differ_without_topology
from tests.visualization.browser_code.served_page import Served, values

SERVED = "closed-loop-ideal"
NAME = "hapticlink.commands.view_second_run"


def second_runs(served: Served) -> list[int]:
    """The processes of second runs below the page's server."""

    def children(process: str) -> list[str]:
        return Path(f"/proc/{process}/task/{process}/children").read_text().split()

    below = [c for server in children(str(served.process.pid)) for c in children(server)]
    return [int(c) for c in below if NAME in Path(f"/proc/{c}/cmdline").read_text()]


def test_two_settings_run_under_one_mouse(served: Served, window: Callable[..., Page]) -> None:
    """Without its topology controller B follows the mouse further, has energies of its own, and the
    controls that act on it leave A as it is."""
    page = window(served.url)
    page.page.click("#compare")
    page.until("view.frame?.b && view.frame.t < 1 && view.stage.limits")
    page.pull(0.03, 0.03)
    page.until("[view.frame, view.frame.b].every((f) => Math.hypot(...f.F_hand) > 0.3)")
    page.page.mouse.up()
    differ_without_topology(page)
    page.page.mouse.up()
    page.page.click("#acts")
    page.until("document.querySelector('[data-control=\"controller.topology\"]').checked")
    page.page.click("#compare")
    page.until("!view.frame?.b && view.frame?.t < 1")


def test_a_second_run_gets_its_changes_alone_and_leaves_no_process(served: Served) -> None:
    with served.window() as window:
        window.until(lambda new: "controls" in new)
        window.send(type="time", do="pause")
        window.send(type="compare", on=True)
        window.send(type="compare", on=True)
        window.set("graphics.rate", 10, b=True)
        found = window.until(
            lambda new: values(new["controls"].get("b", {})).get("graphics.rate") == 10
        )
        assert values(found["controls"])["graphics.rate"] == 30
        assert len(second_runs(served)) == 1
        window.until(lambda new: "b" in new["frame"] and new["scene"].get("runs") == 2)
        times = set[tuple[float, float]]()
        for _ in range(20):  # of the second one, before it begins anew and since
            frame = window.until(lambda new: "b" in new["frame"])["frame"]
            times.add((frame["t"], frame["b"]["t"]))
        assert len(times) <= 2
        window.send(type="time", do="resume")
        window.until(lambda new: min(new["frame"]["t"], new["frame"]["b"]["t"]) > 0.2)
        window.send(type="compare", on=False)
        window.until(lambda new: "b" not in new["frame"] and new.get("scene", {}).get("runs") == 1)
        window.until(lambda new: not second_runs(served))


def test_both_begin_anew_where_one_begins_with_the_hold_model(served: Served) -> None:
    """Else the other run would be ahead for good, by more than the half second that is waited."""
    with served.window() as window:
        window.until(lambda new: "controls" in new)
        window.send(type="compare", on=True)
        for b in (True, False):
            window.until(lambda new: min(_times(new)) > 0.5)
            window.set("model", True, b=b)
            window.until(lambda new, b=b: _has_model(new, b) and np.ptp(_times(new)) < 0.25)
            assert _has_model(window.newest, not b) is not b
        window.send(type="compare", on=False)
        window.until(lambda new: not second_runs(served) and new["scene"].get("runs") == 1)
        window.set("model", False)
        window.until(lambda new: not _has_model(new, False))


def _times(new: dict[str, Any]) -> tuple[float, float]:
    return new["frame"]["t"], new["frame"].get("b", {"t": -1.0})["t"]


def _has_model(new: dict[str, Any], b: bool) -> bool:
    controls = values(new["controls"].get("b", {}) if b else new["controls"])
    held = controls.get("holds.virtual_environment.P_c -> controller.P_c")
    return bool(controls.get("model")) and held == "model"


def test_which_of_both_runs_has_diverged_is_said(served: Served) -> None:
    """With 100 times the damping of the coupling B diverges, and A does not."""
    with served.window() as window:
        window.until(lambda new: "controls" in new)
        window.send(type="compare", on=True)
        window.until(lambda new: new.get("scene", {}).get("runs") == 2)
        window.set("gains.controller.B_pc", 100, b=True)
        window.send(type="hand", at=[0.06, 0.03], user="")
        found = window.until(lambda new: new.get("state", {}).get("ended"))
        assert found["state"]["b"]
        assert "diverged" in found["state"]["ended"]
        window.send(type="hand", at=None, user="")
        window.send(type="compare", on=False)
        window.until(lambda new: not second_runs(served) and new["scene"].get("runs") == 1)


def test_a_second_run_that_dies_ends_the_comparison(served: Served) -> None:
    """What it refuses is said before."""
    with served.window() as window:
        window.send(type="compare", on=True)
        window.until(lambda new: new.get("scene", {}).get("runs") == 2)
        connection = "virtual_environment.Lambda_inv -> controller.Lambda_inv"
        window.set(f"holds.{connection}", "no such", b=True)
        window.until(lambda new: "no such" in new.get("refused", {}).get("why", ""))
        os.kill(second_runs(served)[0], signal.SIGKILL)
        window.until(
            lambda new: "the second run has ended" in new.get("refused", {}).get("why", "")
        )
        window.until(lambda new: new.get("scene", {}).get("runs") == 1)
