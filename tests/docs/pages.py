"""The pages of the project, and the examples in them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    p for folder in (".", "docs", "docs/scenes", "results/*") for p in ROOT.glob(f"{folder}/*.md")
)
"""README, CHANGELOG, docs/ with the pages of scenes, and the pages of results/."""
_BLOCK = re.compile(r'^```(\w*)(?: title="(.+?)")?\n(.*?)^```', re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A code block: its language, the file name in its title, if it has one, and its text."""

    language: str
    title: str
    text: str

    @property
    def commands(self) -> list[str]:
        """The commands of a shell block, without comments and redirections."""
        lines = self.text.replace("\\\n", " ").splitlines()
        bare = (re.sub(r"\s(#|> ).*", "", line) for line in lines)
        return [" ".join(line.split()) for line in bare if line.strip()]


def name(page: Path) -> str:
    """The path of a page in the checkout."""
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path, *languages: str) -> Iterator[Block]:
    """The code blocks of a page in one of the languages, in its order."""
    for found in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if found[0] in languages:
            yield Block(*found)


def prose(page: Path) -> str:
    """The text of a page without its code blocks."""
    return _BLOCK.sub("", page.read_text(encoding="utf-8"))
