"""The page in Chromium: what the mouse does to the run, and what the page shows of it."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.visualization.browser_code.chromium import (
    REAL_TIME_FACTOR,
    Page,
    assert_slow_motion,
)
from tests.visualization.browser_code.served_page import CONSTRAINED, FREE, Served

Window = Callable[..., Page]


def at_the_start(served: Served, window: Window) -> Page:
    """A page of a run that begins: wherever other tests have left the linkage, it stands still."""
    page = window(served.url)
    page.until("view.frame?.t > 0.4")
    page.page.click("#reset")
    page.until("view.frame?.t < 0.3 && view.stage.limits")
    return page


@pytest.mark.parametrize(("way", "moved"), [(FREE, 0.02), (CONSTRAINED, 0.0)])
def test_a_drag_moves_the_linkage_along_its_free_direction_alone(
    served: Served, window: Window, way: tuple[float, float], moved: float
) -> None:
    page = at_the_start(served, window)
    start = np.array(page.get("view.frame.x.slice(0, 2)"))
    page.pull(*(0.02 * np.array(way)))
    if moved:
        to_go = f"{way[0]} * (f.x[0] - {start[0]}) + {way[1]} * (f.x[1] - {start[1]}) - {moved}"
        page.until(f"((f) => Math.abs({to_go}) < 1e-3)(view.frame)")
    else:
        page.until("Math.hypot(...view.frame.F_hand.slice(0, 2)) > 1")
    page.run_for(1.0)
    found = np.array(page.get("view.frame.x.slice(0, 2)")) - start
    assert way @ found == pytest.approx(moved, abs=2e-3)
    page.page.mouse.up()
    page.until("Math.hypot(...view.frame.F_hand.slice(0, 2)) < 0.1")


def test_the_page_says_what_to_do_until_somebody_does_it(served: Served, window: Window) -> None:
    page = window(served.url)
    assert page.page.inner_text("#door").startswith(
        "Press and drag anywhere. Along the pink line it resists."
    )
    page.pull(0.0, 0.0)
    page.until("document.getElementById('door').hidden")
    page.page.mouse.up()


def test_a_run_that_begins_anew_is_pulled_on(served: Served, window: Window) -> None:
    page = at_the_start(served, window)
    page.pull(*(0.02 * np.array(CONSTRAINED)))
    page.until("view.frame?.t > 0.8 && Math.hypot(...view.frame.F_hand.slice(0, 2)) > 1")
    page.page.keyboard.press("r")
    page.until("view.frame?.t < 0.6")
    page.until("view.frame?.t > 0.3 && Math.hypot(...view.frame.F_hand.slice(0, 2)) > 1")
    page.page.mouse.up()
    page.until("Math.hypot(...view.frame.F_hand.slice(0, 2)) < 0.1")


def test_arrow_keys_pull_and_let_go(served: Served, window: Window) -> None:
    page = window(served.url)
    page.page.keyboard.down("ArrowUp")
    page.until("view.frame.F_hand[1] > 0.1")
    page.page.keyboard.up("ArrowUp")
    page.until("Math.hypot(...view.frame.F_hand.slice(0, 2)) < 0.1")


def test_the_wheel_zooms_about_the_pointer_and_shift_moves(served: Served, window: Window) -> None:
    page = window(served.url)
    box = page.page.locator("#scene").bounding_box()
    x, y = box["x"] + 0.3 * box["width"], box["y"] + 0.4 * box["height"]
    under = f"view.stage.toWorld({x - box['x']}, {y - box['y']})"
    before, scale = page.get(under), page.get("view.stage.scale")
    page.page.mouse.move(x, y)
    page.page.mouse.wheel(0, -200)
    page.until(f"view.stage.scale > 1.2 * {scale}")
    wide = page.get("(([a, b]) => b - a)(view.stage.limits[0])")
    assert page.get(under) == pytest.approx(before, abs=0.02 * wide)
    page.page.keyboard.down("Shift")
    page.page.mouse.down()
    page.page.mouse.move(x + 60, y, steps=3)
    page.page.mouse.up()
    page.page.keyboard.up("Shift")
    moved = 60 / page.get("view.stage.scale")
    page.until(f"Math.abs({under}[0] + {moved} - {before[0]}) < {0.02 * wide + 0.1 * moved}")
    assert page.get("view.stage.pulls.size") == 0
    page.pull(0.005, 0.0)  # what is pressed is where it is seen
    target = page.get("[...view.stage.pulls.values()][0].target")
    held_at = page.get("view.frame.handle.slice(0, 2)")
    assert np.hypot(*np.subtract(target, held_at)) < 0.01
    page.until("view.frame.F_hand[0] > 0.1")
    page.page.mouse.up()


REACHED = """[...document.querySelectorAll('button, select, input, summary')].filter((each) => {
  if (!each.checkVisibility()) return false;
  each.scrollIntoView({ block: "center" });
  const box = each.getBoundingClientRect();
  const at = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return !(each.contains(at) || at?.contains(each)) || box.left < 0 || box.right > innerWidth + 1;
}).map((each) => each.id || each.dataset.control || each.textContent)"""
"""The buttons and controls that a finger cannot reach: cut, or with something over them."""


def test_every_button_and_control_of_a_phone_can_be_reached(served: Served, window: Window) -> None:
    page = window(served.url, 390, 844)
    for fold in page.page.query_selector_all("summary"):
        if fold.is_visible():
            fold.click()
    assert len(page.page.query_selector_all("button, select, input, summary")) > 15
    assert page.get(REACHED) == []
    assert page.get("document.documentElement.scrollWidth") == 390


def test_restore_sets_back_what_was_changed(served: Served, window: Window) -> None:
    page = window(served.url)
    page.page.fill("[data-control='gains.controller.K_pc']", "0.5")
    said = (
        "document.querySelector('[data-control=\"gains.controller.K_pc\"]').parentNode.textContent"
    )
    page.until(f"!{said}.includes(' 100 N/m') && {said}.includes('316')")
    page.page.click("#restore")
    page.until(f"{said}.includes('100 N/m')")


def test_time_goes_as_slowly_as_the_slider_says(served: Served, window: Window) -> None:
    page, other = window(served.url), window(served.url)
    page.page.fill("[data-control='speed']", "0")
    other.until(f"{REAL_TIME_FACTOR} === '0.05×'")
    assert_slow_motion(page, 0.05)
    page.page.click("#restore")
    other.until(f"{REAL_TIME_FACTOR} === '1×'")


def test_idle_charts_are_scaled_by_what_can_be_felt(served: Served, window: Window) -> None:
    """No axis is shorter than 1 mm, 0.5 N, 1 mJ."""
    page = window(served.url)
    page.page.click("#reset")
    page.until("view.frame?.t < 0.3 && view.stage.limits")
    written = """new Promise((done) => {
      const own = CanvasRenderingContext2D.prototype.fillText, found = [];
      CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
        if (this.canvas.closest("figure")) found.push(Number(text));
        own.call(this, text, ...rest);
      };
      setTimeout(() => { CanvasRenderingContext2D.prototype.fillText = own; done(found); }, 300);
    })"""
    ticks = page.get(written)
    assert ticks
    assert min(abs(tick) for tick in ticks if tick) >= 0.25


MOVES = """{
  const send = WebSocket.prototype.send, [id] = view.stage.pulls.keys();
  window.sent = [];
  WebSocket.prototype.send = function (text) {
    sent.push(JSON.parse(text));
    send.call(this, text);
  };
  for (const clientX of [300, 310, 320]) {
    const move = { pointerId: id, clientX, clientY: 200 };
    view.stage.canvas.dispatchEvent(new PointerEvent("pointermove", move));
  }
}"""
"""Three moves of the pointer that pulls, at one instant."""


def test_the_hand_pulls_to_where_the_mouse_has_stopped(served: Served, window: Window) -> None:
    page = window(served.url)
    page.pull(0.0, 0.0)
    page.get(MOVES)
    page.until("sent.length")
    target = "[...view.stage.pulls.values()][0].target"
    page.until(f"JSON.stringify(sent.at(-1).at) === JSON.stringify({target})")
    page.page.mouse.up()


def test_a_control_changes_the_run_and_is_seen_in_a_second_window(
    served: Served, window: Window
) -> None:
    first, second = window(served.url), window(served.url)
    first.page.fill("[data-control='graphics.rate']", "9")
    said = "document.querySelector('[data-control=\"graphics.rate\"]').parentNode.textContent"
    second.until(f"{said}.includes('10.0 Hz')")
    first.page.uncheck("[data-control='controller.topology']")
    second.until("!document.querySelector('[data-control=\"controller.topology\"]').checked")
    second.page.check("[data-control='controller.topology']")
    first.until("document.querySelector('[data-control=\"controller.topology\"]').checked")
    first.page.close()
    second.run_for(0.3)


def test_pause_and_step(served: Served, window: Window) -> None:
    page = window(served.url)
    page.page.click("#pause")
    page.until("view.state.paused")
    still = page.get("view.frame.t")
    page.page.click("#step")
    page.until(f"view.frame.t > {still}")
    assert page.get("view.frame.t") < still + 0.1
    page.page.click("#pause")
    page.run_for(0.1)


def test_nothing_is_cut_off_in_wide_and_narrow_windows(served: Served, window: Window) -> None:
    page = window(served.url)
    for size in ((1600, 900), (800, 1000), (360, 640)):
        page.page.set_viewport_size({"width": size[0], "height": size[1]})
        page.run_for(0.1)
        nothing_is_cut_off(page, size)


def test_the_words_of_a_control_are_its_label_and_each_control_has_a_name(
    served: Served, window: Window
) -> None:
    """A click on the words of a slider is one on the slider, and not on the output beside it."""
    page = window(served.url)
    page.until("document.querySelector('[data-control]')")
    named = """[...document.querySelectorAll("button, input, select")].filter((control) =>
      !control.textContent.trim() && !control.ariaLabel
      && control.labels[0]?.control !== control)"""
    labelled = """[...document.querySelectorAll("[data-control]")].filter((control) =>
      control.labels.length !== 1 || control.labels[0].control !== control)"""
    assert page.get(f"{named}.map((control) => control.outerHTML)") == []
    assert page.get(f"{labelled}.map((control) => control.outerHTML)") == []
    gain = page.page.inner_text("label:has([data-control='gains.controller.k_j']) output")
    assert gain == "200 N/m per kg"
    page.page.locator("label:has([data-control='graphics.rate'])").click(position={"x": 5, "y": 5})
    assert page.get("document.activeElement.dataset.control") == "graphics.rate"


SCENE_WITH_AND_WITHOUT_THE_HINT = """[false, true].map((gone) => {
  document.getElementById("door").hidden = gone;
  return JSON.stringify(document.getElementById("scene").getBoundingClientRect());
})"""


def test_in_a_narrow_window_the_hint_is_beside_the_linkage_and_nothing_moves_when_it_goes(
    served: Served, window: Window
) -> None:
    page = window(served.url, 400, 800)
    page.until("!document.getElementById('door').hidden")
    canvas, hint = (page.page.locator(name).bounding_box() for name in ("#scene", "#door"))
    assert hint["y"] >= canvas["y"] + canvas["height"]
    page.pull(0.01, 0.01)
    page.until("document.getElementById('door').hidden")
    page.page.mouse.up()
    with_it, without = page.get(SCENE_WITH_AND_WITHOUT_THE_HINT)  # at one instant
    assert with_it == without


def nothing_is_cut_off(page: Page, size: tuple[int, int]) -> None:
    boxes = {
        name: page.page.locator(name).bounding_box() for name in ("#stage", "#charts", "#controls")
    }
    for box in boxes.values():
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= size[0]
        assert min(box["width"], box["height"]) > 150
    apart = [*boxes.values()]
    for i, a in enumerate(apart):
        for b in apart[i + 1 :]:
            beside = a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"]
            above = a["y"] + a["height"] <= b["y"] or b["y"] + b["height"] <= a["y"]
            assert beside or above
    assert page.get("document.documentElement.scrollWidth") <= size[0]
