"""Words that were retired, in pages and in what the package says: the glossary's stand instead."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs.draw_buildings import FILES
from tests.docs.pages import PAGES, name, prose

RETIRED = {
    r"slow side|fast side|graphics side": "at the graphics rate, at the haptic rate",
    r"frame rate|update rate": "graphics rate",
    r"monodromy|joint spectral radius test": "lifted map",
    r"end[- ]effector|tool tip": "handle, operational point",
    r"master algorithm|co-simulation engine": "co-simulation",
    r"force feedback|felt with the eye|feel with the eye": "rendering; watch where it resists",
    r"motors are told|told to the motors": "motor commands",
    r"made up by the hold|holds? makes? (one|it) up": "reconstructed by the hold",
    r"judged fastest": "fastest to analyse",
    r"damping that (is lacking|lacks)": "damping shortage",
    r"pose without rest": "pose without equilibrium",
    r"lets? all others go": "passes all other frequencies",
    r"Table 6\.1 linkage": "five-bar in the hand",
}
"""Pattern and what is said instead (docs/glossary.md)."""


ANY = re.compile("|".join(RETIRED), re.IGNORECASE)


def retired(text: str) -> list[str]:
    text = " ".join(text.split())
    if not ANY.search(text):  # of most texts; one search instead of many
        return []
    return [
        f"{found[0]!r}: say {instead}"
        for pattern, instead in RETIRED.items()
        for found in re.finditer(rf"\b(?:{pattern})\b", text, re.IGNORECASE)
    ]


def strings(path: Path) -> Iterator[str]:
    """The texts of a module, docstrings among them, as the API's page quotes these."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_pages_use_the_words_of_the_glossary(page: Path) -> None:
    assert retired(prose(page)) == []


def test_messages_and_docstrings_use_the_words_of_the_glossary() -> None:
    said = {path: words for path in FILES.values() if (words := retired(" ".join(strings(path))))}
    assert said == {}


def test_a_retired_word_is_found() -> None:
    assert retired("at a Frame\nrate of 30 Hz") == ["'Frame rate': say graphics rate"]
