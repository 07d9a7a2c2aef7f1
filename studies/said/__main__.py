"""`python -m studies.said`: verdicts of fresh scenes, and what runs say of each printed number.

A line of JSON a scene in OUT/said.jsonl; what has a line is not done again."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from typing import Any

import hapticlink as hl
from studies.said.cases import drawn
from studies.said.measure import Checked, claims
from studies.said.page import write

FIRST, COUNT = 5800400, 30


def judged(seed: int) -> dict[str, Any]:
    """The scene of a seed, its verdict, and its claims."""
    base, options = drawn(seed)
    row: dict[str, Any] = {"seed": seed, "scene": base, "options": options}
    try:
        scene = Checked(base, options)
    except (hl.InputFault, hl.Fault) as fault:
        return row | {"refused": str(fault)}
    return row | {"finding": scene.finding, "claims": list(claims(scene))}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m studies.said", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/stability/said"))
    parser.add_argument("--first", type=int, default=FIRST, help="The first seed.")
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--every", type=int, default=1, help="Each n-th seed alone.")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    path = asked.out / "said.jsonl"
    path.touch()
    for seed in range(asked.first, asked.first + asked.count, asked.every):
        if seed in {row["seed"] for row in _rows(path)}:
            continue
        row = judged(seed)
        with path.open("a", encoding="utf-8") as out:
            print(json.dumps(row, default=float), file=out)
        said = Counter(claim["says"] for claim in row.get("claims", []))
        counts = ", ".join(f"{n} {word}" for word, n in said.items())
        print(f"{seed}: {counts or row.get('refused')}", flush=True)
    print(write(asked.out, _rows(path)))


def _rows(path: Path) -> list[dict[str, Any]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return sorted(map(json.loads, lines), key=lambda row: row["seed"])


if __name__ == "__main__":
    main()
