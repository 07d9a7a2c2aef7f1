"""One page for all tests of a module."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.visualization.browser_code.served_page import Served


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with Served(tmp_path_factory.mktemp("view")) as page:
        yield page
