"""The page before anything runs: the mechanism where it starts, and which block is being built."""

from __future__ import annotations

import re
from contextlib import ExitStack
from pathlib import Path

import pytest

from hapticlink.fmus import blocks as block_fmus
from hapticlink.fmus import cache, lock
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from tests.visualization.browser_code.chromium import Page, chromium
from tests.visualization.browser_code.served_page import Served


@pytest.fixture
def lock_of_last_block(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """In an empty cache, the lock of the FMU of closed-loop-ideal that is built last."""
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "cache"))
    last = blocks(load_viewed_scene("closed-loop-ideal")).built[-1]
    with monkeypatch.context() as patched:
        patched.setattr(cache, "get_or_build", lambda material, *_: cache.key(material))
        key = block_fmus.build_block(last.block, last.settings, tmp_path, packaging="native")
    return tmp_path / "cache" / "locks" / f"{key}.lock"


def test_the_mechanism_is_seen_and_the_blocks_are_told_before_they_are_built(
    lock_of_last_block: Path, tmp_path: Path
) -> None:
    with ExitStack() as stack:
        browser = stack.enter_context(chromium())
        with lock.hold_lock(lock_of_last_block, lambda: None):
            served = Served(tmp_path, scene="closed-loop-ideal")
            stack.callback(served.__exit__)
            page = Page(browser, served.url, shown="view.stage.frame && view.building")
            page.until("document.getElementById('note').textContent.includes('block 5 of 5')")
            assert page.page.inner_text("#title") == "Five-bar in the hand, idealised"
            assert page.get("view.frame") is None
            before = page.get("view.stage.frame.poses")
            page.page.mouse.click(400, 400)  # pulls nothing
            assert page.get("view.stage.pulls.size") == 0
            assert not page.page.is_visible("#door")
            page.until("/, [0-9]+ s/.test(document.getElementById('note').textContent)")
            note = page.page.inner_text("#note")
            assert re.fullmatch(r"building block 5 of 5: \w+, \d+ s", note)
        page.until("view.frame && !document.getElementById('door').hidden")
        for body, pose in before.items():
            assert page.get(f"view.frame.poses['{body}']") == pytest.approx(pose, abs=1e-4)
        assert page.faults == []
