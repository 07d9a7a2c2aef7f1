"""The page of a pass over fresh scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies.said.measure import APART, CLOSE, LEAST

WORDS = "agree", "undecided", "contradicted"


def write(folder: Path, rows: Sequence[dict[str, Any]]) -> Path:
    """README.md of all rows; returns its path."""
    every = [(row["seed"], claim) for row in rows for claim in row.get("claims", [])]
    counts = Counter(claim["says"] for _, claim in every)
    said = ", ".join(f"{counts[word]} {word}" for word in WORDS)
    table = [
        "| seed | scene | verdict | agree | undecided | contradicted |\n|---|---|---|--:|--:|--:|"
    ]
    for row in rows:
        of_scene = Counter(claim["says"] for claim in row.get("claims", []))
        cells = " | ".join(str(of_scene[word]) for word in WORDS)
        finding = row.get("finding") or f"refused: {row['refused'].splitlines()[0]}"
        told = finding.replace("|", "/")
        table.append(f"| {row['seed']} | `{row['scene']}` | {told} | {cells} |")
    parts = [
        "# Printed numbers against runs",
        f"Of {len(every)} numbers that `stability` and `run` print of {len(rows)} fresh scenes: "
        f"{said}.",
        "Made by `python -m studies.said` ([how](../../../studies/said/__init__.py)). Scenes are "
        "drawn with their seeds: linkages, devices, holds, rates, gains, delays, hands, walls, two "
        f"users. Growth rates agree within {CLOSE:.0%} or {LEAST:g} 1/s, the spread of the run's "
        f"two windows and the told uncertainty; beyond {APART:.0%} they contradict. A margin "
        "agrees where nothing but a drift grows at .9 times it, and something does at 1.1 times "
        "it; of delays and frames, a haptic period further. A remedy agrees where the scene with "
        "its options is told the same rate, and a run shows it. Every number is in "
        "[said.jsonl](said.jsonl).",
        "\n".join(table),
    ]
    for word in WORDS[1:]:
        lines = [
            f"- {seed}: {claim['what']}, told {claim['told']:.4g}: {claim['why']}"
            for seed, claim in every
            if claim["says"] == word
        ]
        parts += [f"## {word.capitalize()}", "\n".join(lines) or "None."]
    path = folder / "README.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path
