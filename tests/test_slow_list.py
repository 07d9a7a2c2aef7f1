"""The list of slow tests names tests that are there."""

import pytest

from tests.conftest import COLLECTED, SLOW


def test_an_entry_is_a_file_a_test_or_a_case(pytestconfig: pytest.Config) -> None:
    entries, collected = SLOW.read_text().splitlines(), pytestconfig.stash[COLLECTED]
    assert len(entries) == len({*entries})
    for entry in entries:
        path, _, test = entry.partition("::")
        text = (SLOW.parent / path).read_text()
        assert not test or f"def {test.partition('[')[0]}(" in text, entry
    if not any("::" in given for given in pytestconfig.args):  # files as a whole
        gone = [e for e in entries if e.partition("::")[0] in collected and e not in collected]
        assert not gone, "no such test or case"
