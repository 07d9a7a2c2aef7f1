"""Messages of a page, the light, and the constrained directions, without a page."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.visualization.live.messages import Gain, Hand, Time, newest, parse
from hapticlink.visualization.live.viewed_scene import viewed
from hapticlink.visualization.mechanism.picture import Part, directions


def test_a_pull_is_read() -> None:
    assert parse('{"type": "hand", "at": [0.1, -0.2]}') == Hand("hand", (0.1, -0.2))
    other = '{"type": "hand", "at": null, "user": "left"}'
    assert parse(other) == Hand("hand", None, "left")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '"hand"',
        "{}",
        '{"type": "exec", "at": null}',
        '{"type": "hand"}',
        '{"type": "hand", "at": [0.1]}',
        '{"type": "hand", "at": [0.1, 0.2, 0.3]}',
        '{"type": "hand", "at": [0.1, "0.2"]}',
        '{"type": "hand", "at": [0.1, NaN]}',
        '{"type": "hand", "at": [0.1, 1e999]}',
        '{"type": "hand", "at": [0.1, 0.2], "more": 1}',
        '{"type": "hand", "at": null, "user": 1}',
        '{"type": "jitter", "value": 1.0}',
        '{"type": "rate", "value": 0}',
        '{"type": "rate", "value": 1e-320}',
        '{"type": "rate", "value": -3}',
        '{"type": "rate", "value": true}',
        '{"type": "delay", "connection": "a", "value": 2}',
        '{"type": "gain", "name": "controller.K_pc", "factor": -1}',
        '{"type": "topology", "on": 1}',
        '{"type": "time", "do": "stop"}',
        json.dumps({"type": "hold", "connection": "x" * 201, "hold": "zoh"}),
        json.dumps({"type": "hold", "connection": "x", "hold": "z" * 5000}),
        b'{"type": "hand", "at": null}',
    ],
)
def test_what_is_no_message_is_refused(text: str | bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse(text)


def test_constrained_directions_are_those_of_the_projector() -> None:
    """Against the singular vectors of the projector's range, also where it has rank 2 out of the
    plane."""
    part = Part("", "directions", ("P_c",), (9,), directions(), sparse=True)

    def shown(projector: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(part.value({"P_c": projector.ravel().tolist()})).reshape(-1, 2)

    line = np.array([math.cos(0.3), math.sin(0.3), 0.0])
    (found,) = shown(np.outer(line, line))
    assert abs(np.dot(found, line[:2])) == pytest.approx(1.0)
    assert len(shown(np.diag([0.0, 0.0, 1.0]))) == 0
    both = shown(np.diag([1.0, 1.0, 0.0]))
    assert np.allclose(both @ both.T, np.eye(2))
    basis, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 2)))
    _, sizes, axes = np.linalg.svd(basis[:2].T)
    found = shown(basis @ basis.T)
    assert np.hypot(*found.T) == pytest.approx(sizes)
    assert np.abs(np.sum(found * axes, axis=1)) == pytest.approx(sizes)


def test_a_scene_without_a_mechanism_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "device.toml"
    path.write_text('title = "A device"\nduration = 1.0\n[device]\n')
    with pytest.raises(InputFault, match=r"device.toml: has no \[linkage\].*closed-loop"):
        viewed(str(path))


def test_the_mouse_takes_the_place_of_the_hand() -> None:
    scene = viewed("two-hands", ["graphics.rate=20"])
    assert scene.hand
    assert scene.hand.type == "spring"
    assert scene.hands["left"].type == "arm"
    assert scene.packaging == "native"
    two = viewed("two-users")
    assert two.hands["left"] == two.hand
    assert viewed("closed-loop", ["packaging=python"]).packaging == "python"


def test_of_many_messages_the_newest_of_each_control_is_kept() -> None:
    gain = [Gain("gain", name, float(i)) for i in range(5) for name in "ab"]
    step = [Time("time", "step")] * 2
    pulls = [Hand("hand", at, user) for user in ("", "left") for at in ((0.0, 0.0), None)]
    found = newest([*gain, *step, *pulls])
    assert found == [*gain[-2:], *step, pulls[1], pulls[3]]
