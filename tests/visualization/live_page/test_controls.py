"""What a page can change, without a page."""

from __future__ import annotations

import hapticlink as hl
from hapticlink.visualization.interactive_scene.offered_controls import Settings
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.controls import Controls
from tests.api.test_real_time import ENERGY, ran


def test_gains_of_a_spring_whose_energy_is_limited_are_no_controls() -> None:
    """Nor are they restored, where the page changed them before the hold was chosen."""
    offered: list[set[str]] = []

    def turn(live: hl.RealTime) -> None:
        controls = Controls(live, Settings(gains={"controller.K_pc": 10.0, "controller.k_j": 2.0}))
        controls.restore()
        offered.append({gain["name"] for gain in controls.described()["gains"]})
        live.stop()

    ran("closed-loop-direct", turn)
    ran("closed-loop-direct", turn, *ENERGY)
    assert offered[0] - offered[1] == {"controller.K_pc", "controller.B_pc"}


def test_the_rate_of_the_scene_without_jitter_is_no_change() -> None:
    """So a run that begins anew has the scene's own steps, and the verdict is on them."""
    settings = Settings()
    rates: list[float | None] = []

    def turn(live: hl.RealTime) -> None:
        controls = Controls(live, settings)
        for value in (64.0, 30.0):
            controls.apply(messages.Rate("rate", value))
            rates.append(settings.rate)
        live.stop()

    ran("closed-loop-direct", turn)
    assert rates == [64.0, None]
