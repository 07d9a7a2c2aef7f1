"""What the report's experiments rest on, and in what a run that is one of them differs.

Chapter 6 runs on the setup of chapter 4: encoders and a Nicosia observer (4.2.1), a graphics block
that a PD controller pulls at the operational point (4.2.2, figure 4.4), matrices from that block,
and Baumgarte's stabilisation (3.2). Section B.6 adds the local model of interaction (B.17) and
semi-implicit Euler. Neither compensates Coriolis and centripetal terms (5.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from hapticlink.orchestrator.scene.toml_keys import parts, value


class Premise(NamedTuple):
    """What a setting of a scene decides, the setting, its value in the report, and what another
    value means, by value."""

    of: str
    key: str
    value: object
    instead: Mapping[object, str]


CHAPTER_6 = (
    Premise("sensing", "sensing", "encoders", {"ideal": "no encoders and no observer"}),
    Premise(
        "graphics copy",
        "graphics.sync",
        "operational",
        {
            "exact": "the graphics copy is placed on the mechanism's coordinates, not pulled at "
            "its operational point (graphics.sync)",
            "joint": "the graphics copy is pulled at every joint (graphics.sync)",
        },
    ),
    Premise(
        "matrices",
        "directions_from",
        "graphics",
        {"mechanism": "no matrices from the graphics block"},
    ),
    Premise(
        "stabilisation",
        "mechanism.stabilization",
        "baumgarte",
        {"projection": "loops closed by projection", "none": "loops left to open"},
    ),
    Premise(
        "velocity terms",
        "controller.bias",
        "none",
        {"full": "Coriolis and centripetal terms compensated"},
    ),
)
OF_THE_REPORT: dict[str, tuple[Premise, ...]] = {
    "chapter 6": (
        *CHAPTER_6,
        Premise("local model", "local_model", False, {True: "the local model (B.17)"}),
    ),
    "section B.6": (
        *CHAPTER_6,
        Premise("local model", "local_model", True, {False: "no local model (B.17)"}),
        Premise("integrator", "mechanism.integrator", "semi-implicit-euler", {}),
    ),
}
"""By the `experiment` of a scene."""


def find_differences(scene: Mapping[str, Any]) -> Iterator[str]:
    """In what a run of a scene (its tables, with all defaults) differs from the experiment of the
    report that it is; nothing for one that is none."""
    for premise in OF_THE_REPORT.get(scene.get("experiment", ""), ()):
        if (found := value(scene, parts(premise.key))) != premise.value:
            yield premise.instead.get(found, f"{premise.key} = {found}")


def describe_experiment(scene: Mapping[str, Any]) -> Iterator[str]:
    """A line that names the report's experiment and which of its premises are others."""
    if scene.get("experiment"):
        differences = "; ".join(find_differences(scene))
        but = f", but for: {differences}" if differences else ""
        of = ", ".join(premise.of for premise in OF_THE_REPORT[scene["experiment"]])
        yield f"as in the report's {scene['experiment']} are {of}{but}; nothing else is compared"
