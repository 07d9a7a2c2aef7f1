"""Text for a terminal, which acts on control characters in the strings of an FMU or a scene."""

from __future__ import annotations

from typing import TextIO


def printable(text: str) -> str:
    """`text` with escapes (\\x1b) of the characters that are neither printable nor end a line."""
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def say(*texts: object, sep: str = " ", file: TextIO | None = None) -> None:
    """Print `texts`, printable."""
    print(printable(sep.join(map(str, texts))), file=file)
