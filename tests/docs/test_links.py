"""Links, anchors and the files that pages name exist."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.pages import PAGES, ROOT, name, prose

LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
MADE = {"info", "maps", "reports", "runs", "site", "standalone", "sweeps", "tuned"}
"""Folders that commands write in the checkout."""
FOLDERS = {p.name for p in ROOT.iterdir() if p.is_dir() and not p.name.startswith(".")} - MADE


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub makes of a page's headings."""
    titles = re.findall(r"^#+ +(.+)$", prose(page), re.MULTILINE)
    shown = (re.sub(r"\[(.+?)\]\(.+?\)", r"\1", title).lower() for title in titles)
    return {re.sub(r"[^\w\- ]", "", title).strip().replace(" ", "-") for title in shown}


def broken(page: Path) -> Iterator[str]:
    for link in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            yield link
        elif anchor and anchor not in anchors(target):
            yield f"{link}: no such heading"


def missing(page: Path) -> Iterator[str]:
    """Modules, and files and folders of the checkout, that a page names and that do not exist."""
    for code in CODE.findall(prose(page)):
        path = code.split("::")[0]
        module = re.fullmatch(r"[\w./-]+\.py", path)
        inside = re.fullmatch(r"[\w.-]+(/[\w.-]+)+/?", path) and path.split("/")[0] in FOLDERS
        if (module or inside) and not (ROOT / path).exists():
            yield code


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_leads_somewhere(page: Path) -> None:
    assert [*broken(page)] == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_file_named_exists(page: Path) -> None:
    assert [*missing(page)] == []


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A `b`: c\n[x](none.md) [y](#a-b-c) [z](#d) `no/such.py` `docs/none.md`\n")
    assert [*broken(page)] == ["none.md", "#d: no such heading"]
    assert [*missing(page)] == ["no/such.py", "docs/none.md"]
