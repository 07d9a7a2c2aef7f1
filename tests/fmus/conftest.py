"""FMUs built once for all tests of this folder, and a way to drive them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.fmus.check import Session, session
from tests.fmus import sample_components


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmus")
    return {c.name: build(c, folder) for c in sample_components.EVERY}


@pytest.fixture(scope="session")
def native_fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("native")
    return {c.name: build_native(c, folder) for c in sample_components.EVERY}


@pytest.fixture(scope="session")
def native_fmus_3(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Of FMI 3.0."""
    folder = tmp_path_factory.mktemp("native3")
    return {c.name: build_native(c, folder, fmi=3) for c in sample_components.EVERY}


@pytest.fixture
def opened(fmus: dict[str, Path]) -> Iterator[Callable[[str], Session]]:
    """name -> Session; closed at the end of the test."""
    with ExitStack() as stack:
        yield lambda name: stack.enter_context(session(fmus[name]))
