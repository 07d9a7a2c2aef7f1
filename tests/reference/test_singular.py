"""A short form of `hapticlink bench singular`: what one shift for all right-hand sides costs."""

from pathlib import Path

import pytest

from benchmarks import singular


def test_one_mu_for_all_errs_at_some_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(singular, "RATES", range(400, 2400, 210))
    text = singular.bench(tmp_path, False, lambda *told: None, "hapticlink bench singular")
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| rk4")]
    worst = {row[0].removeprefix("| "): float(row[3]) for row in rows}
    assert worst["rk4, 1e-8 for all"] > 1e3 * worst["rk4, each its own"]
