"""Where the programs of these tests are kept."""

from pathlib import Path

import pytest

from tests.programs import built


@pytest.fixture(scope="session", autouse=True)
def kept_programs(shared_folder: Path) -> None:
    built.folder = shared_folder
