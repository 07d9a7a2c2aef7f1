"""The numbers of docs/model-hold.md are those of results/model/, and the table of docs/holds.md is
that of results/mismatch/."""

import csv
import re
from pathlib import Path

import pytest

from studies.mismatch.figures import short

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "model-hold.md").read_text(encoding="utf-8")
FOUND = (ROOT / "results" / "model" / "README.md").read_text(encoding="utf-8")


def rows(name: str, of: str = "model") -> list[dict[str, str]]:
    with (ROOT / "results" / of / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def table(heading: str, text: str = PAGE) -> list[list[str]]:
    """The rows of the first table below a heading."""
    lines = text[text.index(f"\n## {heading}\n") :].splitlines()
    begin = next(i for i, line in enumerate(lines) if line.lstrip().startswith("|"))
    end = next(i for i in range(begin, len(lines)) if not lines[i].lstrip().startswith("|"))
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[begin + 2 : end]]


def test_the_attack_on_the_theorem() -> None:
    told = [(name.replace("none", "all premises"), *n) for name, *n in table("Attack")]
    assert told == [(r["premise"], r["w_grew"], r["unbounded"]) for r in rows("theorem")]


def test_the_orders_of_error() -> None:
    lines = PAGE[PAGE.index("| Hz | last, c = 0 |") :].splitlines()[2:8]
    *by_rate, orders = [[cell.strip() for cell in line.split("|")[2:-1]] for line in lines]
    cells = rows("orders")
    rules = list(dict.fromkeys((r["rule"], r["lead"]) for r in cells))
    assert len(rules) == len(orders) == 4
    for column, rule in enumerate(rules):
        found = [r for r in cells if (r["rule"], r["lead"]) == rule]
        told = [row[column] for row in by_rate] + [orders[column]]
        for text, value in zip(told, [*(r["rms_over_foretold"] for r in found), ""], strict=True):
            value = float(value or found[-1]["order"])
            assert (
                value > 1e3 if text == "unstable" else float(text) == pytest.approx(value, abs=6e-3)
            )


def test_growth_rates_margins_and_what_is_left_of_a_motion() -> None:
    cells = rows("growth")
    assert all(r["same"] == "True" for r in cells)
    known = [float(r["map"]) for r in cells]
    low, high, off = re.search(r"from\n(\S+) to (\S+) 1/s, \[within (\S+) %\]", PAGE).groups()  # type: ignore[union-attr]
    assert (float(low), float(high)) == (round(min(known), 2), round(max(known)))
    apart = max(abs(float(r["run"]) / float(r["map"]) - 1) for r in cells)
    assert 100 * apart <= float(off)
    (some,) = re.search(r"stiffnesses up to which (\S+) stable cells", PAGE).groups()  # type: ignore[union-attr]
    assert int(some) == len([r for r in cells if r["run_above_margin"]])
    told = table("Growth rates of a run")
    found = [r for r in cells if r["left_of_1_mm_um"]]
    keys = ("linkage", "gains", "hz", "hand_n_per_m", "map")
    keys += ("left_of_1_mm_um", "left_with_half_lead_um")
    assert told == [
        [f"{float(r[k]):.10g}" if k in keys[-2:] else r[k] for k in keys] for r in found
    ]


def test_the_energy_account_and_the_cost() -> None:
    assert table("An energy account") == table("With an energy account", FOUND)
    by_rate: dict[str, list[str]] = {}
    for r in rows("cost"):
        by_rate.setdefault(r["graphics_hz"], []).append(r["us_per_tick"])
    assert table("Cost") == [[rate, *values] for rate, values in by_rate.items()]


def test_the_holds_that_the_study_takes() -> None:
    page = (ROOT / "docs" / "holds.md").read_text(encoding="utf-8")
    by_rate: dict[str, dict[str, str]] = {}
    for r in rows("advice", "mismatch"):
        gains = "" if r["gains"] == "medium" else f", {r['gains']}"
        within = "" if r["within"] == r["of"] else f" ({r['within']} of {r['of']})"
        told = f"`{r['hold']}`{gains}: {short(float(r['tracking_mm']))}{within}"
        by_rate.setdefault(r["rate"], {})[f"{r['arrangement']}, {r['bias']}"] = told
    columns = ["mobility, none", "mobility, full", "direct, none", "direct, full"]
    found = [[rate, *(of[c] for c in columns)] for rate, of in by_rate.items()]
    assert table("At 10 to 60 Hz", page) == found
