"""The systems that the report's figures show: chapter 6 and section B.6, as the report states them
and idealised."""

from __future__ import annotations

from dataclasses import dataclass

from hapticlink.orchestrator.results.read_results import Results
from studies.report.report_page import Runs, command

DIRECTIONS = "mechanism.directions=true"
ON, OFF = "controller.topology=true", "controller.topology=false"
VARYING = "graphics.rate={min=10, max=50, seed=1}"
"""The report's variable frames (1.3.4)."""


@dataclass(frozen=True)
class System:
    """A scene with options; `name` stands in legends and titles."""

    name: str
    scene: str
    options: tuple[str, ...] = ()

    def but(self, name: str, *options: str) -> System:
        """The same with further options, under another name."""
        return System(name, self.scene, (*self.options, *options))

    def run(self, runs: Runs, *options: str) -> Results:
        """Its results, with the mechanism's own count of constrained directions."""
        return runs(self.scene, *self.options, DIRECTIONS, *options)

    def command(self, *options: str) -> str:
        """The command of that run."""
        return command(self.scene, *self.options, DIRECTIONS, *options)


IDEALISATIONS = (
    "sensing=ideal",
    "local_model=false",
    "graphics.sync=exact",
    "mechanism.integrator=rk4",
    "mechanism.stabilization=projection",
)
STATED_6 = System("as stated, 30 Hz", "closed-loop")
VARYING_6 = STATED_6.but("as stated, 10 to 50 Hz", VARYING)
IDEAL_6 = System("idealised, 30 Hz", "closed-loop-ideal")
STATED_B6 = System("as stated, 30 Hz", "closed-loop-b1")
VARYING_B6 = STATED_B6.but("as stated, 10 to 50 Hz", VARYING)
IDEAL_B6 = STATED_B6.but("idealised, 30 Hz", *IDEALISATIONS)
OF_CHAPTER_6 = (STATED_6, VARYING_6, IDEAL_6)
OF_SECTION_B6 = (STATED_B6, VARYING_B6, IDEAL_B6)
