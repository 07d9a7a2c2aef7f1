"""The pages, with all panels open, as axe-core judges them: contrast, names, structure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.shared_fixtures import status
from tests.visualization.browser_code.chromium import Page
from tests.visualization.browser_code.served_page import Served

axe = pytest.importorskip("axe_playwright_python.base", reason="axe-core is not installed")
SERVED = "two-users"  # of the shipped scenes the one with most curves and controls
Window = Callable[..., Page]
SIZES = pytest.mark.parametrize(
    ("width", "dark"), [(1280, False), (400, False), (1280, True)], ids=["wide", "phone", "dark"]
)
OPENED = "document.querySelectorAll('details').forEach((each) => { each.open = true; })"
FOUND = """axe.run(document).then(({ violations, passes }) => [
  violations.flatMap(({ id, nodes }) => nodes.map(({ html }) => `${id}: ${html}`)),
  passes.length,
])"""


def require_nothing_found(page: Page) -> None:
    page.page.evaluate(f"() => {{ {OPENED} }}")
    page.page.evaluate(axe.AXE_SCRIPT)
    found, rules = page.get(FOUND)
    assert found == []
    assert rules > 20


@SIZES
def test_the_live_page(served: Served, window: Window, width: int, dark: bool) -> None:
    page = window(served.url, width, 800, dark=dark)
    page.pull(0.005, 0.005)
    page.run_for(0.5)
    require_nothing_found(page)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("standalone") / "demo.html"
    assert status("view", "--standalone", path) == 0
    return path


@SIZES
def test_the_page_in_one_file_with_two_runs(
    file: Path, window: Window, width: int, dark: bool
) -> None:
    """As it begins, and while a remedy is pressed and B differs."""
    page = window(f"file://{file}#graphics.rate=12", width, 800, dark=dark)
    require_nothing_found(page)
    page.page.click("#remedy")
    page.page.click("#compare")
    page.until("view.frame?.b")
    require_nothing_found(page)


def test_it_finds_what_is_wrong(window: Window, tmp_path: Path) -> None:
    path = tmp_path / "bad.html"
    path.write_text("<title>x</title><html lang=en><main><h1>x</h1><button></button></main></html>")
    page = window(f"file://{path}", shown="document.body")
    with pytest.raises(AssertionError, match="button-name"):
        require_nothing_found(page)
