"""FMUs built at most once for all tests of this folder, and a way to drive them."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from hapticlink.fmus.build_fmu import build, build_native
from hapticlink.fmus.check import FmuSession, session
from tests.fmus import sample_components


class Built(dict[str, Path]):
    """FMUs by name, each built where it is first asked for: a worker has a part of the tests."""

    def __init__(self, make: Callable[[str], Path]) -> None:
        super().__init__()
        self._make = make

    def __missing__(self, name: str) -> Path:
        self[name] = self._make(name)
        return self[name]


SAMPLES = {component.name: component for component in sample_components.EVERY}


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Built:
    folder = tmp_path_factory.mktemp("fmus")
    return Built(lambda name: build(SAMPLES[name], folder))


@pytest.fixture(scope="session")
def native_fmus(tmp_path_factory: pytest.TempPathFactory) -> Built:
    folder = tmp_path_factory.mktemp("native")
    return Built(lambda name: build_native(SAMPLES[name], folder))


@pytest.fixture(scope="session")
def native_fmus_3(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Of FMI 3.0."""
    folder = tmp_path_factory.mktemp("native3")
    return Built(lambda name: build_native(SAMPLES[name], folder, fmi=3))


@pytest.fixture
def opened(fmus: dict[str, Path]) -> Iterator[Callable[[str], FmuSession]]:
    """name -> Session; closed at the end of the test."""
    with ExitStack() as stack:
        yield lambda name: stack.enter_context(session(fmus[name]))
