"""`python -m studies.devices`: judges every shipped device, runs what checks it, and writes
results/devices."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import hapticlink as hl
from studies.devices import measure, page


def row(name: str) -> dict[str, Any]:
    """All that the page has of a device."""
    given = measure.options(name)
    judged = measure.judged(name)
    device = hl.scene(measure.SCENE, given).device
    assert device is not None
    errors, alone = {}, {}
    for bias in ("full", "none"):
        for sensing in ("ideal", "encoders"):
            changed = given | {"controller.bias": bias, "sensing": sensing}
            errors[f"bias {bias}, {sensing}"] = tracked(changed)
            without = {"controller.topology": False, "duration": measure.ALONE}
            alone[f"bias {bias}, {sensing}"] = tracked(changed | without)
    return {
        "device": name,
        "renders": device.handle.angle,
        "verdict": judged.says,
        "worst": {"hand": judged.hand, "growth": judged.growth},
        "margin": judged.margin,
        "checks": [asdict(check) | {"agrees": check.agrees} for check in judged.checks],
        "rendered": asdict(measure.rendered(device)),
        "errors": errors,
        "without_topology": alone,
    }


def tracked(options: measure.Options) -> tuple[float, str, float]:
    """Of a run: the largest distance (mm) of operational point and handle, how it ended, when."""
    run = hl.run(measure.SCENE, options, figures=False)
    end = run.run["end"]
    return float(run.tracking().distance_mm.max()), end["reason"], end["time"]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m studies.devices", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/devices"))
    asked = parser.parse_args()
    rows = []
    for name in measure.planar_devices():
        rows.append(row(name))
        print(f"{name}: {rows[-1]['verdict']}", flush=True)
    asked.out.mkdir(parents=True, exist_ok=True)
    (asked.out / "devices.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    (asked.out / "README.md").write_text(page.text(rows), encoding="utf-8")
    print(asked.out)


if __name__ == "__main__":
    main()
