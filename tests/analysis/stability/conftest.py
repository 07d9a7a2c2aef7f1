"""What tests of verdicts share."""

from __future__ import annotations

import pytest

from hapticlink.analysis.stability import judge_scene
from hapticlink.analysis.stability.margin_and_remedy import Margin


@pytest.fixture
def no_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Verdicts come without margins and remedies, which are most of their time."""
    monkeypatch.setattr(judge_scene, "improvements", lambda *_: (Margin(None, None, None), ()))
