"""Fresh scenes, judged by `stability` and checked by runs of 60 s.

    python -m fuzz.verdicts --seed 53 --count 30 OUT.jsonl

Each scene is drawn with a seed: linkage, masses, start, gains, rates, hold, delay, where the
mechanism runs, hand. The worst case in hands is then run: in that pose, in that hand, whose target
is 0.2 mm and 2 mrad off at first. It is stable if the speed of the handle in the last 5 s is less
than half of what it was early, or is rounding; a fault or a limit cycle is unstable. Drifts,
marginal cases, and growth by less than e^2 in a run are not decided by it. Where the verdict is
unstable, its remedy is written into the scene, which is run in the same case again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import Case, worst_case
from hapticlink.analysis.stability.hands import OWN, standing
from hapticlink.analysis.stability.verdict_record import Stability
from hapticlink.components.specs.hand import ArmHand, SpringHand
from hapticlink.orchestrator.base.signal_names import HANDLE_VELOCITY

SECONDS = 60.0
EARLY, LATE = (0.25, 2.0), 5.0
"""Times (s) between which a motion is early, and how long before the end it is late."""
OFF = (2e-4, 0.0, 2e-3)
QUIET = 1e-7
"""Speed (m/s and rad/s) of a handle at rest."""
MOST = 0.5
SCENES = ("closed-loop-ideal", "closed-loop-direct", "serial", "closed-loop-b1")


def drawn(seed: int) -> tuple[str, dict[str, Any]]:
    """A scene and its options."""
    rng = np.random.Generator(np.random.PCG64(seed))

    def spread(factor: float) -> float:
        return float(np.exp(rng.uniform(-1, 1) * np.log(factor)))

    name = str(rng.choice(SCENES))
    haptic = int(rng.choice([256, 400, 512, 800, 1024]))
    frame = int(rng.integers(4, 40))
    stiff, turned = 100.0 * spread(3.0), 0.5 * spread(3.0)
    if name == "closed-loop-direct":
        turned *= 0.3
    options: dict[str, Any] = {
        "haptics.rate": haptic,
        "graphics.rate": f"{haptic}/{frame}" if rng.random() < 0.5 else int(rng.integers(12, 90)),
        "hold": str(rng.choice(["zoh", "foh", "lead", "mean"])),
        "controller.teleoperation.stiffness": [stiff, stiff, turned],
        "controller.teleoperation.damping": [
            *2 * [2 * float(rng.uniform(0.3, 1.5)) * (0.2 * stiff) ** 0.5 * 3],
            float(rng.uniform(0.03, 0.6)) * turned,
        ],
        "sensing": "ideal",
    }
    for body in ("link1", "link2"):
        mass = float(rng.uniform(0.3, 2.0))
        options[f"linkage.body.{body}.mass"] = mass
        options[f"linkage.body.{body}.inertia"] = 2.1e-4 * mass * spread(2.0)
    if rng.random() < 0.3:
        late = float(rng.integers(1, 4)) / haptic
        options["delays"] = {"virtual_mechanism.x": late, "virtual_mechanism.v": late}
    if rng.random() < 0.4:
        damping = float(rng.uniform(0.5, 8.0))
        options["hand"] = {"type": "constant", "wrench": [-0.5, 0.2, 0.0]}
        options["hand.damping"] = [damping, damping, 1e-3 * damping]
    options["stop_when"] = ""
    return name, options


def run_case(name: str, options: dict[str, Any], found: Stability, case: Case) -> str:
    """stable or unstable, by a run in a pose and a hand."""
    pose = next(p for p in found.poses if p.name == case.pose)
    hand = found.hands[case.hand]
    assert isinstance(hand, ArmHand | SpringHand)  # the free handle is no case here
    table = standing(hand, np.add(pose.point, OFF))
    changes = {"hand": table, "linkage.start": pose.joints, "linkage.start_velocity": {}}
    changed = {k: v for k, v in options.items() if not k.startswith("hand")}
    run = hl.run(name, {**changed, **changes, "duration": SECONDS}, figures=False)
    if run.fault:
        return "unstable"
    speed, time_ = np.abs(run[HANDLE_VELOCITY]).max(axis=1), run.time(HANDLE_VELOCITY)
    early = speed[(time_ >= EARLY[0]) & (time_ <= EARLY[1])].max()
    late = speed[time_ >= SECONDS - LATE].max()
    return "stable" if late < max(MOST * early, QUIET) else "unstable"


def judged(seed: int, poses: int = 3) -> dict[str, Any]:
    """The row of a scene."""
    name, options = drawn(seed)
    row: dict[str, Any] = {"seed": seed, "scene": name, "options": options}
    begun = time.process_time()
    try:
        found = hl.stability(name, options, poses=poses)
    except hl.Fault as fault:
        return row | {"refused": str(fault)}
    row["cpu"] = round(time.process_time() - begun, 2)
    row |= {"verdict": found.verdict, "finding": found.finding}
    in_hands = [case for case in found.cases if not case.free]
    case = worst_case(in_hands)
    row |= {"case": case.record(), "own": OWN in found.hands}
    row["run"] = run_case(name, options, found, case)
    says = "unstable" if found.in_hands == "unstable" else "stable"
    slow = 0.0 < case.growth < 2.0 / SECONDS  # less than e^2 in a run: hidden by what decays
    decided = found.in_hands not in ("drifts", "marginal") and not slow
    row["right"] = row["run"] == says if decided else "not decided"
    if found.remedies:
        row["remedy"] = asdict(found.remedies[0])
        pairs = dict(option.split("=", 1) for option in found.remedies[0].options)
        remedied = options | {key: _value(value) for key, value in pairs.items()}
        row["run_remedied"] = run_case(name, remedied, found, case)
    return row


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def rows(seed: int, count: int, poses: int = 3) -> Iterator[dict[str, Any]]:
    """`count` rows, of scenes with seeds from `seed` on."""
    for i in range(count):
        yield judged(seed + i, poses)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=23)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--poses", type=int, default=3)
    given = parser.parse_args()
    with given.out.open("a", encoding="utf-8") as out:
        for row in rows(given.seed, given.count, given.poses):
            print(json.dumps(row, default=str), file=out, flush=True)
            print(row["seed"], row.get("finding", row.get("refused")), row.get("run"))


if __name__ == "__main__":
    main()
