"""A replay in Chromium: its slider, two runs, and the file without a network."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.visualization.replay import replay_page
from hapticlink.visualization.replay.recorded_frames import Recorded
from tests.visualization.browser_code.chromium import Page

LINK = 0.042
"""Length (m) of link 1 of Table 6.1, which turns about the origin."""
SEEK = """([t]) => { const slider = document.getElementById("slider");
  slider.value = t; slider.dispatchEvent(new Event("input")); }"""
SECOND = """([x, y]) => {
  const stage = view.stage, [px, py] = stage.toScreen([x, y]), ratio = devicePixelRatio;
  const copy = Object.assign(document.createElement("canvas"), { width: 9, height: 9 });
  const context = copy.getContext("2d", { willReadFrequently: true });
  context.drawImage(stage.canvas, 4 - ratio * px, 4 - ratio * py);
  const part = context.getImageData(0, 0, 9, 9).data;
  let found = 0;
  for (let i = 0; i < part.length; i += 4)
    if (part[i] > 190 && Math.abs(part[i + 1] - 102) < 40 && part[i + 2] < 60) found += 1;
  return found; }"""
"""Pixels about a point (m) that have the colour of the second run."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    root = tmp_path_factory.mktemp("replay")
    hl.run(
        "closed-loop-ideal", {"graphics.rate": 10, "duration": 1.2}, out=root / "on", figures=False
    )
    off = {"graphics.rate": 10, "duration": 1.0, "controller.topology": False}
    hl.run("closed-loop-ideal", off, out=root / "off", figures=False)
    return root / "on", root / "off"


@pytest.fixture(scope="module")
def file(runs: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "replay.html"
    replay_page.write_replay([Recorded(str(folder)) for folder in runs], path)
    return path


@pytest.fixture
def page(browser: Any, window: Callable[..., Page], file: Path) -> Page:
    browser.set_offline(True)
    return window(file.as_uri(), dark=True)


def elbow(folder: Path, t: float) -> tuple[np.ndarray, float]:
    """End of link 1 (m), and angle of link 2, at the newest sample of the CSV."""
    r = hl.load(folder)
    q = r["virtual_mechanism.q"][r.time("virtual_mechanism.q") <= t + 1e-9][-1]
    return LINK * np.array([np.cos(q[0]), np.sin(q[0])]), q[0] + q[1]


def seek(page: Page, t: float) -> None:
    page.page.evaluate(SEEK, [t])
    page.until(f"Math.abs(view.t - {t}) < 1e-3")


def test_the_slider_moves_both_linkages_to_their_recorded_poses(
    page: Page, runs: tuple[Path, Path]
) -> None:
    for t in (0.0, 0.99, 0.3717):
        seek(page, t)
        for i, folder in enumerate(runs):
            x, y, angle = page.get(f"view.frames[{i}].poses.link2")
            place, turned = elbow(folder, t)
            assert [x, y, angle] == pytest.approx([*place, turned], abs=2e-6)


def test_a_run_that_has_ended_stays_at_its_last_pose_and_says_so(
    page: Page, runs: tuple[Path, Path]
) -> None:
    seek(page, 1.2)
    place, turned = elbow(runs[1], 9.0)
    assert page.get("view.frames[1].poses.link2") == pytest.approx([*place, turned], abs=2e-6)
    page.until("document.querySelectorAll('h2')[1].textContent.includes('done at 1 s')")


def test_keys_go_a_frame_on_and_back_and_play(page: Page) -> None:
    seek(page, 0.5)
    page.page.keyboard.press("ArrowRight")
    page.until("Math.abs(view.t - (0.5 + 1 / 512)) < 1e-4")
    page.page.keyboard.press("Shift+ArrowLeft")
    page.until("Math.abs(view.t - (0.5 - 9 / 512)) < 1e-4")
    page.page.keyboard.press("Space")
    page.until("view.playing && view.t > 0.6")
    page.page.keyboard.press("Space")
    page.page.keyboard.press("End")
    page.until("Math.abs(view.t - 1.2) < 2e-3 && !view.playing")


def test_two_runs_in_one_picture(page: Page, runs: tuple[Path, Path]) -> None:
    seek(page, 0.99)
    place = (0.5 * elbow(runs[1], 0.99)[0]).tolist()
    assert page.page.evaluate(SECOND, place) == 0
    page.page.click("#layout")
    page.until("view.overlaid && view.views[1].section.hidden")
    page.page.wait_for_timeout(200)
    place = (0.5 * elbow(runs[1], 0.99)[0]).tolist()
    assert page.page.evaluate(SECOND, place) > 5
    page.page.keyboard.press("o")
    page.until("!view.overlaid && !view.views[1].section.hidden")


def test_a_click_on_a_chart_or_lane_goes_to_its_time(page: Page) -> None:
    chart = page.page.locator("[data-chart='tracking error'] canvas")
    box = chart.bounding_box()
    chart.click(position={"x": 44 + (box["width"] - 46) / 2, "y": 20})
    page.until("Math.abs(view.t - 0.6) < 0.02")
    lane = page.page.locator(".lane[data-kind] canvas").first
    lane.click(position={"x": lane.bounding_box()["width"] / 4, "y": 5})
    page.until("Math.abs(view.t - 0.3) < 0.02")


def test_nothing_is_cut_off_in_wide_and_narrow_windows(page: Page) -> None:
    for size in ((1600, 900), (800, 1000), (360, 640)):
        nothing_is_cut_off(page, size)


def nothing_is_cut_off(page: Page, size: tuple[int, int]) -> None:
    page.page.set_viewport_size({"width": size[0], "height": size[1]})
    page.page.wait_for_timeout(200)
    assert page.get("document.documentElement.scrollWidth") <= size[0]
    for canvas in page.page.locator("#stages canvas").all():
        box = canvas.bounding_box()
        assert min(box["width"], box["height"]) > 150
    # The picture fits into its window: the limits of the plane are within the canvas.
    assert page.get(
        "[[0, 0], [1, 1]].every(([i, j]) => { const s = view.stage;"
        " const [x, y] = s.toScreen([s.limits[0][i], s.limits[1][j]]);"
        " const { clientWidth: width, clientHeight: height } = s.canvas;"
        " return x > -1 && y > -1 && x < width + 1 && y < height + 1; })"
    )
