"""The page that needs no server, opened from the disk in Chromium."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from benchmarks import standalone as bench
from hapticlink.fmus.native import compiler
from hapticlink.orchestrator.open_scene import load
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.standalone import page as standalone_page
from tests.shared_fixtures import status
from tests.visualization.browser_code.chromium import (
    AT,
    Page,
    assert_slow_motion,
    differ_without_topology,
    goes_on_when_mended,
    has_its_first_minute,
)
from tests.visualization.browser_code.javascript import NODE, javascript
from tests.visualization.live_page.test_controls import POINTS
from tests.visualization.live_page.test_page_in_space import SERVED_TEXT

BYPASS_CSP = False
Window = Callable[..., Page]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("standalone") / "demo.html"
    assert status("view", "closed-loop-ideal", "--standalone", path) == 0
    return path


def dragged(page: Page, folder: Path, point: str = "") -> tuple[list[str], np.ndarray]:
    """What the page saves of a run of a second with a drag: the names and the rows. point: what the
    hand takes after its drag, for a second one."""
    page.page.click("#pause")
    page.page.click("#record")
    page.until("view.state.recording && view.frame?.t === 0 && view.stage.limits")
    page.pull(0.02, -0.02)
    page.page.keyboard.press("Space")
    page.until("view.frame?.t > 0.4")
    x, y, scale = page.page.evaluate(AT)
    page.page.mouse.move(x + 0.03 * scale, y - 0.01 * scale, steps=5)
    page.until("view.frame?.t > 1.1")
    page.page.mouse.up()
    if point:
        # While it holds no point the page's hand damps the handle; that of a table lets go of it.
        page.until("Math.hypot(...view.frame.F_hand) < 1e-8")
        page.page.select_option("[data-control='linkage.operational_point']", point)
        page.run_for(0.2)
        page.pull(0.01, 0.02)
        page.run_for(0.4)
        page.page.mouse.up()
    with page.page.expect_download() as download:
        page.page.click("#record")
    path = folder / "saved.csv"
    download.value.save_as(path)
    with path.open() as text:
        names, *rows = csv.reader(text)
    return names, np.array(rows, float)


def test_a_drag_gives_the_numbers_of_a_run_with_the_same_forces(
    file: Path, window: Window, tmp_path: Path
) -> None:
    """The run's hand is the force that was recorded, at each tick."""
    page = window(f"file://{file}", dark=True)
    names, rows = dragged(page, tmp_path)
    require_same_numbers(names, rows)


def require_same_numbers(
    names: list[str], rows: np.ndarray, *options: str, near: float = 1e-9, **changes: object
) -> None:
    """A run over the whole seconds of the rows has their numbers."""
    rows = rows[: 1 + 512 * (len(rows) // 512)]
    force = [names.index(f"hand.F[{i}]") for i in (1, 2, 3)]
    assert np.abs(rows[:, force]).max() > 1
    hand = {"type": "profile", "table": rows[:, [0, *force]].tolist()}
    common = {"hand": hand, "stop_when": "", "record": {"signals": "all"}}
    scene = load("closed-loop-ideal", options)
    table = hl.run(scene, common | {"duration": float(rows[-1, 0])} | changes)["haptics"]
    assert np.array_equal(rows[:, 0], table["time"])
    columns = [name for name in table.columns[1:] if not name.startswith("hand.")]
    assert len(columns) > 40
    for name in columns:
        assert rows[:, names.index(name)] == pytest.approx(table[name], rel=near, abs=near), name


def test_the_hand_takes_another_point_as_at_a_given_time(window: Window, tmp_path: Path) -> None:
    """It holds none for a frame, and is let go meanwhile; a reset begins with the point of the
    start."""
    file = tmp_path / "points.html"
    given = [part for option in POINTS for part in ("--set", option)]
    assert status("view", "closed-loop-ideal", "--standalone", file, *given) == 0
    page = window(f"file://{file}")
    names, rows = dragged(page, tmp_path, "other")
    asked, held = (
        rows[:, names.index(f"virtual_mechanism.{kind}_point")] for kind in ("asked", "held")
    )
    assert [*held[np.flatnonzero(np.diff(held, prepend=-1.0))]] == [1.0, 0.0, 2.0]
    begun = rows[np.argmax(asked == 2.0) - 1, 0]
    event = {"time": begun, "set": {"linkage.operational_point": "other"}}
    require_same_numbers(names, rows, *POINTS, at=[event], near=1e-5)
    page.page.click("#reset")
    page.until("view.frame?.t > 0.2")
    chosen = "document.querySelector('[data-control=\"linkage.operational_point\"]').value"
    assert page.get(chosen) == "other"


def test_a_linkage_in_space_is_pulled_and_turned_in_its_file(
    window: Window, tmp_path: Path
) -> None:
    """As behind a server: to a place of the view's plane, and turned by a drag beside it."""
    scene, file = tmp_path / "space.toml", tmp_path / "space.html"
    scene.write_text(SERVED_TEXT)
    assert status("view", scene, "--standalone", file) == 0
    assert file.stat().st_size < 300_000
    page = window(f"file://{file}")
    start, rows = (np.array(page.get(f"view.{of}")) for of in ("frame.x", "stage.view.rows"))
    page.pull(0.03, 0.02)
    wanted = start + 0.03 * rows[0] + 0.02 * rows[1]
    page.until(f"view.frame.x.every((v, i) => Math.abs(v - {wanted.tolist()}[i]) < 2e-3)")
    page.page.mouse.up()
    box = page.page.locator("#scene").bounding_box()
    page.page.mouse.move(box["x"] + 30, box["y"] + 30)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + 80, box["y"] + 30, steps=5)
    page.page.mouse.up()
    page.until("Math.abs(view.stage.view.turned + 1.1) < 1e-9")


def test_no_request_leaves_the_page(file: Path, browser: Any, window: Window) -> None:
    """Nor is anything asked for that its content security policy forbids, which is in force."""
    asked: list[str] = []
    browser.on("request", lambda request: asked.append(request.url))
    page = window(f"file://{file}")
    page.pull(0.01, -0.01)
    page.run_for(0.3)
    page.page.mouse.up()
    assert len(asked) == 2
    assert {url.partition(":")[0] for url in asked} == {"file", "blob"}


def test_nothing_is_cut_off_in_wide_and_narrow_windows(file: Path, window: Window) -> None:
    page = window(f"file://{file}")
    for width, height in ((1600, 900), (390, 844)):
        page.page.set_viewport_size({"width": width, "height": height})
        page.run_for(0.1)
        assert page.get("document.documentElement.scrollWidth") <= width
        for name in ("#stage", "#charts", "#controls", "#compare", "#hear"):
            box = page.page.locator(name).bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width


def test_a_link_carries_the_settings(file: Path, window: Window) -> None:
    page = window(f"file://{file}#graphics.rate=10&hold=foh&delay=0.02&weather=fine")
    rate = "document.querySelector('[data-control=\"graphics.rate\"]').parentNode.textContent"
    page.until(f"{rate}.includes('10.0 Hz')")
    holds = page.get("[...document.querySelectorAll('#controls select')].map((each) => each.value)")
    assert len(holds) > 1
    assert {*holds} == {"foh"}
    assert "weather=fine: this scene has no such control" in page.get("view.refused")
    page.page.uncheck("[data-control='controller.topology']")
    page.until("location.hash.includes('controller.topology=false')")
    link = page.get("location.href")
    assert "weather" not in link
    again = window(link)
    again.until("!document.querySelector('[data-control=\"controller.topology\"]').checked")
    again.until("document.querySelector('#controls select').value === 'foh'")


def test_time_goes_as_slowly_as_the_address_says(file: Path, window: Window) -> None:
    """Both runs, where there are two."""
    page = window(f"{file.as_uri()}#speed=0.05")
    page.until("view.frame")
    page.page.click("#compare")
    page.until("view.frame?.b")
    assert_slow_motion(page, 0.05)
    assert page.get("view.frame.b.t === view.frame.t")
    page.page.click("#restore")
    page.until("!location.hash.includes('speed')")


def test_two_settings_run_under_one_mouse(file: Path, window: Window) -> None:
    """With the same settings both have the same bits; without its topology controller B follows the
    mouse further, and has energies of its own."""
    page = window(f"file://{file}")
    page.page.click("#compare")
    page.until("view.frame?.b && view.stage.limits")
    page.pull(0.03, 0.03)
    page.run_for(0.5)
    alike = "JSON.stringify(view.frame.x) === JSON.stringify(view.frame.b.x)"
    assert page.get(alike)
    page.page.mouse.up()
    differ_without_topology(page)
    assert not page.get(alike)
    page.page.mouse.up()


def test_a_page_is_compiled_once_until_its_scene_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second page has the bytes of the first, out of the cache."""
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "cache"))
    compile_, compiled = compiler._compile, []

    def count(source: Any, folder: Path, target: str, options: Any) -> bytes:
        compiled.append(target)
        return compile_(source, folder, target, options)

    monkeypatch.setattr(compiler, "_compile", count)
    scene, pages = load_viewed_scene("closed-loop-ideal", ["packaging=python"]), []
    for changed in (scene, scene, load(scene, {"device.body.crank.mass": 0.13})):
        pages.append(standalone_page.html(changed, "demo"))
        compiled.append("page")
    assert compiled == ["wasm32-wasi", "page", "page", "wasm32-wasi", "page"]
    assert pages[0] == pages[1] != pages[2]


def test_the_first_minute_of_a_mechanism_at_the_graphics_rate(
    window: Window, tmp_path: Path
) -> None:
    """As served; and it is heard from there, too."""
    file = tmp_path / "direct.html"
    assert status("view", "--standalone", file) == 0  # the scene that needs no name
    page = window(f"file://{file}")
    has_its_first_minute(page)
    goes_on_when_mended(page)
    page.page.click("#listen")
    page.until("view.sound.context?.state === 'running'")
    assert page.get("document.getElementById('hear').value") == "force"
    page.page.click("#listen")
    page.until("!view.sound.context")


LISTEN = """(() => {
  const analyser = new AnalyserNode(view.sound.context), heard = new Float32Array(2048);
  view.sound.node.connect(analyser);
  view.loudest = 0;
  setInterval(() => {
    analyser.getFloatTimeDomainData(heard);
    view.loudest = Math.max(view.loudest, ...heard.map(Math.abs));
  }, 20);
})()"""


def test_a_drag_is_heard_once_it_is_asked_for(file: Path, window: Window) -> None:
    page = window(f"file://{file}")
    assert page.get("view.sound.context ?? null") is None
    page.page.select_option("#hear", "force")
    page.until("view.sound.node && view.sound.context.state === 'running'")
    page.get(LISTEN)
    page.run_for(0.2)
    assert page.get("view.loudest") < 1e-3
    for _ in range(20):
        page.pull(0.03, -0.02)
        page.page.mouse.up()
        if page.get("view.loudest") > 0.01:
            break
    page.until("view.loudest > 0.01")
    page.page.select_option("#hear", "")
    page.until("!view.sound.context")


@pytest.mark.skipif(not NODE, reason="node is not installed")
def test_the_benchmark_runs_a_page_in_every_form(browser: Any) -> None:
    _, _, *forms = bench._measured("pendulum", (), 1, browser)
    assert min(forms) > 1  # times real time: by FMUs, under node and in Chromium


PREPARED = """
  const changed = {}, told = [], c = { rate: (m, ...rate) => told.push(rate) };
  const made = { changed, start: given.start, data: given, c };
  Object.setPrototypeOf(made, Program.prototype);
  const set = (key, value) => {
    try { made.apply({ type: "set", key, value }); } catch (error) { return error.message; }
    return "";
  };
  answer = [given.asked.map((each) => set(...each)), told, changed];
"""


def test_steps_in_a_file_leave_time_for_the_result_and_are_taken_as_at_the_start() -> None:
    """What is refused is not kept, as with a server."""
    start = {
        "graphics.rate": {"value": 16.0},
        "jitter": {"value": 0.0},
        "model": {"value": True, "only_at_start": "--set hold=zoh"},
    }
    asked = [("graphics.rate", 50.0), ("jitter", 0.2), ("graphics.rate", 40.0), ("jitter", 0.2)]
    asked += [("graphics.rate", 45.0), ("model", False)]
    given = {"start": start, "result_after": 0.02, "asked": asked}
    refused, told, kept = javascript("program.js", PREPARED, given)
    early, late = "there after 0.02 s (computing_time)", "make a file with --set hold=zoh"
    assert [bool(line) for line in refused] == [False, True, False, False, True, True]
    assert [early in refused[1], early in refused[4], late in refused[5]] == [True] * 3
    assert told == [[50.0, 0.0], [40.0, 0.0], [40.0, 0.2]]
    assert kept == {"graphics.rate": 40.0, "jitter": 0.2}
