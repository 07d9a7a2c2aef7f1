"""The table of a pass over fresh scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

WORDS = "agree", "undecided", "contradicted"


def write(folder: Path, rows: Sequence[dict[str, Any]]) -> Path:
    """README.md of all rows; returns its path."""
    every = [claim for row in rows for claim in row.get("claims", [])]
    total, counts = len(every), Counter(claim["says"] for claim in every)
    lines = [
        "# Printed numbers against runs",
        "Made by `python -m studies.said` ([how](../../../studies/said/__init__.py)); each scene "
        "is drawn with its seed. Of "
        f"{total} printed numbers of {len(rows)} verdicts {counts['agree']} agree with runs, "
        f"{counts['undecided']} are undecided, {counts['contradicted']} are contradicted. Every "
        "number is in [said.jsonl](said.jsonl).",
        "| seed | scene | verdict | agree | undecided | contradicted |\n|---|---|---|--:|--:|--:|",
    ]
    for row in rows:
        said = Counter(claim["says"] for claim in row.get("claims", []))
        cells = " | ".join(str(said[word]) for word in WORDS)
        finding = row.get("finding") or f"refused: {row['refused'].splitlines()[0]}"
        lines[-1] += (
            f"\n| {row['seed']} | `{row['scene']}` | {finding.replace('|', '/')} | {cells} |"
        )
    for word in WORDS[1:]:
        lines.append(f"## {word.capitalize()}")
        some = [
            f"- {row['seed']}: {claim['what']}, told {claim['told']:.4g}: {claim['why']}"
            for row in rows
            for claim in row.get("claims", [])
            if claim["says"] == word
        ]
        lines.append("\n".join(some) or "None.")
    path = folder / "README.md"
    path.write_text("\n\n".join(lines) + "\n", encoding="utf-8")
    return path
