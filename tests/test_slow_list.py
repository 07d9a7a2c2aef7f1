"""The list of slow tests names tests that are there."""

import pytest

from tests.conftest import COLLECTED, SLOW


@pytest.mark.parametrize("entry", sorted(SLOW.read_text().splitlines()))
def test_an_entry_is_a_file_or_a_test(entry: str, pytestconfig: pytest.Config) -> None:
    path, _, test = entry.partition("::")
    text = (SLOW.parent / path).read_text()
    assert not test or f"def {test.partition('[')[0]}(" in text
    collected = pytestconfig.stash[COLLECTED]
    if path in collected and not any("::" in given for given in pytestconfig.args):
        assert entry in collected, "no such test or case"
