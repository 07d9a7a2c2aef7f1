"""The attack by archives, in short."""

import sys

import pytest

from tests.attack import cases
from tests.attack.archives import KINDS, attack


@pytest.mark.skipif(sys.platform != "linux", reason="forks, with the limits of POSIX")
def test_no_archive_harms_a_run_or_what_stands_beside_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    counts = cases.counted(attack(2 * len(KINDS), seed=7))
    assert {kind: found.total() for kind, found in counts.items()} == dict.fromkeys(KINDS, 2)
    assert not cases.bad(counts), capsys.readouterr().err
