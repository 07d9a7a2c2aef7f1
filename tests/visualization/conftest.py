"""One page and one browser for all tests of a module."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.visualization.browser_code.served_page import SCENE, Served

if TYPE_CHECKING:
    from tests.visualization.browser_code.chromium import Page


@pytest.fixture(scope="module")
def served(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Served]:
    """`view` of the scene that the module calls SERVED, or has the text of as SERVED_TEXT, by
    default one with a free direction."""
    scene = getattr(request.module, "SERVED", "scene.toml")
    text = getattr(request.module, "SERVED_TEXT", SCENE)
    with Served(tmp_path_factory.mktemp("view"), scene=scene, text=text) as page:
        yield page


@pytest.fixture(scope="module")
def browser(request: pytest.FixtureRequest) -> Iterator[Any]:
    """Chromium, in which a module that says BYPASS_CSP = False does nothing that pages forbid."""
    from tests.visualization.browser_code.chromium import chromium  # skips where it is not

    with chromium(getattr(request.module, "BYPASS_CSP", True)) as opened:
        yield opened


@pytest.fixture
def window(browser: Any) -> Iterator[Callable[..., Page]]:
    """(url, ...) -> its page, in which nothing goes wrong until it is closed after the test."""
    from tests.visualization.browser_code.chromium import Page

    pages: list[Page] = []

    def opened(url: str, *size: int, **settings: Any) -> Page:
        pages.append(Page(browser, url, *size, **settings))
        return pages[-1]

    yield opened
    for page in (p.page for p in pages if not p.page.is_closed()):
        page.mouse.up()  # the handle is free before another window pulls it
        page.close()
    assert [page.faults for page in pages] == [[]] * len(pages)
