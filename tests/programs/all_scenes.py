"""Every shipped scene, and every hold, as one FMU beside its run:

    python -m tests.programs.all_scenes

Prints for each the number of outputs that differ in a bit, or why it is refused; exit status 1 if
one differs. The suite has a choice of them (`test_programs`).
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.holds import HOLDS
from tests.programs.built import program
from tests.programs.comparison import differing, outputs, run

SHORT = "duration=1"


def cases() -> Iterator[tuple[str, tuple[str, ...]]]:
    yield from ((scene, (SHORT,)) for scene in hl.shipped())
    for hold in HOLDS:
        for scene in ("closed-loop-ideal", "closed-loop-direct"):
            for rate in (32, 30):
                yield scene, (SHORT, f"graphics.rate={rate}", f"hold={hold}")


def main() -> int:
    worst = 0
    for scene, options in cases():
        with tempfile.TemporaryDirectory() as folder:
            try:
                experiment = run(scene, options, Path(folder))
                found = program(scene, options)
            except InputFault as refused:
                print(scene, *options, "refused:", str(refused).replace("\n", " ")[:300])
                continue
            haptic = experiment.system.timeline.clocks[0].longest
            for step in (haptic, 16 * haptic, 7 * haptic):
                columns = [*differing(outputs(found, experiment, step), experiment)]
                worst = max(worst, len(columns))
                count = f"{len(columns)} differ"
                print(scene, *options, f"steps of {step} ticks:", count, *columns[:3])
        sys.stdout.flush()
    return int(worst > 0)


if __name__ == "__main__":
    sys.exit(main())
