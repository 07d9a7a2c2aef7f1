"""What is no mapping and no text is refused by name."""

from __future__ import annotations

from typing import Any

import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault


@pytest.mark.parametrize(
    ("given", "said"), [({"vary": [1]}, "vary: give"), ({"runs": range(3)}, "runs: give")]
)
def test_what_varies_is_named(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputFault, match=said):
        hl.sweep("pendulum", **given)
