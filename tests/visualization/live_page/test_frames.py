"""What a frame says, against the results of the same run."""

from __future__ import annotations

from typing import Any

import pytest

import hapticlink as hl
from hapticlink.visualization.live_and_standalone.first_messages import describe_power
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.live_page.frames import FrameReader
from tests.visualization.browser_code.javascript import javascript


def test_the_energy_at_the_users_port_is_that_of_the_results() -> None:
    frames: list[FrameReader] = []
    said: list[dict[str, Any]] = []
    seen: list[dict[str, Any]] = []

    def turn(live: hl.RealTime) -> None:
        if not frames:
            frames.append(FrameReader(live))
            said.extend(describe_power(live.system, live.energies()))
            live.set("hand.stiffness", (100.0, 100.0, 0.0))
            live.set("hand.target", (0.03, 0.03, 0.0))
        seen.append(frames[0].frame(live))
        if live.time > 0.3 and "booked" in seen[-1]:
            live.stop()

    made = hl.RealTime(load_viewed_scene("closed-loop-ideal", ["haptics.rate=512"])).run(turn)
    x = made["virtual_mechanism.x"][made.time("virtual_mechanism.x") == seen[-1]["t"]]
    assert seen[-1]["x"] == x[0].tolist()
    shown = [{"t": f["t"], "booked": f["booked"], "stored": f["stored"], "states": []}
             for f in seen if "booked" in f]  # fmt: skip
    port = javascript(
        "energies.js",
        """const energies = new Energies({ power: given.power, port: "port", noticeable: 1e-3 });
        for (const frame of given.shown) energies.add(frame);
        answer = given.shown.at(-1).energy.port;""",
        {"power": said, "shown": shown},
    )
    assert abs(port) > 1e-6
    assert port == pytest.approx(made.run["user_port"]["generated"], rel=1e-9)


def test_the_light_is_the_worst_of_a_second() -> None:
    """A hold generates 0 and 0.5 mJ by turns, of 1 mJ that are noticeable: amber from the first
    time until a second after the last one."""
    times = [i / 60 for i in range(180)]
    frames = [{"t": t, "stored": 0.0, "states": [], "booked": [[5e-4 * (t < 1 and i % 2), 0.0]]}
              for i, t in enumerate(times)]  # fmt: skip
    seen = javascript(
        "energies.js",
        """const power = [{ name: "held", hand: false, counts: false }];
        const energies = new Energies({ power, port: "port", noticeable: 1e-3 });
        for (const frame of given) energies.add(frame);
        answer = given.map((frame) => frame.light);""",
        frames,
    )
    changes = [i for i in range(1, len(seen)) if seen[i] != seen[i - 1]]
    assert [seen[i] for i in changes] == ["amber", "green"]
    assert changes[0] == 1
    assert times[changes[1]] > 1.9


def test_the_light_compares_what_was_generated_with_what_was_put_in() -> None:
    cases = [(0.0, 0.0, "green"), (-1.0, 0.5, "green"), (5e-5, 0.0, "green"), (5e-4, 0.0, "amber"),
             (0.2, 1.0, "amber"), (1.1, 1.0, "red"), (0.1, -1.0, "red")]  # fmt: skip
    expression = "answer = given.map(([generated, put_in]) => light(generated, put_in, 1e-3));"
    assert javascript("energies.js", expression, cases) == [color for *_, color in cases]
