"""The list of slow tests names tests that are there."""

import pytest

from tests.conftest import SLOW


@pytest.mark.parametrize("entry", sorted(SLOW.read_text().splitlines()))
def test_an_entry_is_a_file_or_a_test(entry: str) -> None:
    path, _, test = entry.partition("::")
    text = (SLOW.parent / path).read_text()
    assert not test or f"def {test.partition('[')[0]}(" in text
