"""What a page can change, and its messages, without a page."""

import json

import pytest

import hapticlink as hl
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization.live_and_standalone.choose_model import with_model
from hapticlink.visualization.live_and_standalone.offered_controls import RATE, Offered, Settings
from hapticlink.visualization.live_page.controls import Controls
from hapticlink.visualization.live_page.messages import Hand, SetControl, Time, newest, parse
from tests.api.test_real_time import ENERGY, ran


def test_gains_of_a_spring_whose_energy_is_limited_are_no_controls() -> None:
    """Nor are they restored, where the page changed them before the hold was chosen."""
    offered: list[set[str]] = []

    def turn(live: hl.RealTime) -> None:
        kept = {"gains.controller.K_pc": 10.0, "gains.controller.k_j": 2.0}
        controls = Controls(live, kept)
        controls.restore()
        offered.append({control["key"] for control in controls.described()})
        live.stop()

    ran("closed-loop-direct", turn)
    ran("closed-loop-direct", turn, *ENERGY)
    assert offered[0] - offered[1] == {"gains.controller.K_pc", "gains.controller.B_pc"}


def test_the_rate_of_the_scene_without_jitter_is_no_change() -> None:
    """So a run that begins anew has the scene's own steps, and the verdict is on them."""
    settings: Settings = {}
    rates: list[float | None] = []

    def turn(live: hl.RealTime) -> None:
        controls = Controls(live, settings)
        for value in (64.0, 30.0):
            controls.apply(SetControl("set", RATE, value))
            rates.append(settings.get(RATE))
        live.stop()

    ran("closed-loop-direct", turn)
    assert rates == [64.0, None]


def test_a_change_that_is_refused_is_not_kept() -> None:
    """A hold that there is not, a delay beyond what a scene may have, and a place in space."""
    settings: Settings = {}

    def turn(live: hl.RealTime) -> None:
        controls = Controls(live, settings)
        key = next(c["key"] for c in controls.described() if "choices" in c)
        for message in (SetControl("set", key, "none"), SetControl("set", "holds.x", "zoh")):
            with pytest.raises(hl.InputFault, match=r"^no hold 'none'|^no control"):
                controls.apply(message)
        with pytest.raises(
            hl.InputFault, match=r"^at: this hand is pulled to a place of 2 numbers"
        ):
            controls.apply(Hand("hand", (0.1, 0.2, 0.3)))
        live.stop()

    ran("closed-loop-direct", turn)
    assert settings == {}


POINTS = (
    "linkage.points.middle={body='link2', at=[0.021, 0.0]}",
    "linkage.points.other={body='link4', at=[0.02, 0.0]}",
    "linkage.operational_point=middle",
)


def test_the_hand_takes_another_point_that_the_scene_names() -> None:
    held: list[float] = []

    def turn(live: hl.RealTime) -> None:
        controls = Controls(live, {})
        key = "linkage.operational_point"
        control = next(c for c in controls.described() if c["key"] == key)
        assert (control["choices"], control["value"]) == (["none", "middle", "other"], "middle")
        if (number := live["virtual_mechanism.held_point"].item()) not in held:
            held.append(number)
        if live.time < 0.05:
            with pytest.raises(hl.InputFault, match="no point 'tip'"):
                controls.apply(SetControl("set", key, "tip"))
            controls.apply(SetControl("set", key, "other"))
        if held[-1] == 2.0:
            live.stop()

    ran("closed-loop-ideal", turn, *POINTS)
    assert held == [1.0, 0.0, 2.0]


HELD = "holds.virtual_environment.P_c -> controller.P_c"


def test_settings_that_a_run_cannot_begin_with_are_forgotten_and_said() -> None:
    """So a run begins that was chosen beside them."""
    settings: Settings = {"gains.other": 2.0, HELD: "ahead", "jitter": 0.1}
    said: list[str] = []

    def turn(live: hl.RealTime) -> None:
        said.extend(Controls(live, settings).restore())
        live.stop()

    ran("closed-loop-ideal", turn)
    assert settings == {"jitter": 0.1}
    assert [line.partition(" is as in")[0] for line in said] == ["gains.other", HELD]


@pytest.mark.parametrize(
    ("name", "options", "chosen"),
    [
        ("closed-loop-ideal", {}, False),
        ("closed-loop-ideal", {"hold": "model"}, True),
        ("closed-loop-ideal", {"graphics.sync": "operational"}, None),
        ("closed-loop-ideal", {"directions_from": "mechanism"}, None),
        ("closed-loop-direct", {}, False),
        ("closed-loop-direct", {"coupling": "gauss-seidel-plants"}, None),
    ],
)
def test_the_hold_model_is_offered_where_its_premises_hold(
    name: str, options: dict[str, object], chosen: bool | None
) -> None:
    """There a scene that begins with it has it on a connection, and without it on none."""
    scene = hl.scene(name, options | {"packaging": "python"})
    with build_system(scene) as system:
        assert Offered(scene, system).model is chosen
    for wanted in (True, False) if chosen is not None else ():
        with build_system(with_model(scene, wanted)) as system:
            assert bool({"model", "ahead"} & {c.hold for c in system.connections}) is wanted


def test_a_pull_is_read() -> None:
    assert parse('{"type": "hand", "at": [0.1, -0.2]}') == Hand("hand", (0.1, -0.2))
    other = '{"type": "hand", "at": null, "user": "left"}'
    assert parse(other) == Hand("hand", None, "left")
    rate = '{"type": "set", "key": "graphics.rate", "value": 10, "b": true}'
    assert parse(rate) == SetControl("set", "graphics.rate", 10.0, b=True)
    assert parse('{"type": "set", "key": "controller.topology", "value": true}').value is True


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
        '{"type": "hand", "at": [0.1, 0.2, 0.3, 0.4]}',
        '{"type": "hand", "at": [0.1, "0.2"]}',
        '{"type": "hand", "at": [0.1, NaN]}',
        '{"type": "hand", "at": [0.1, 1e999]}',
        '{"type": "hand", "at": [0.1, 0.2], "more": 1}',
        '{"type": "hand", "at": null, "user": 1}',
        '{"type": "set", "key": "jitter", "value": 1.0}',
        '{"type": "set", "key": "graphics.rate", "value": 0}',
        '{"type": "set", "key": "graphics.rate", "value": 1e-320}',
        '{"type": "set", "key": "graphics.rate", "value": -3}',
        '{"type": "set", "key": "graphics.rate", "value": true}',
        '{"type": "set", "key": "graphics.rate", "value": NaN}',
        '{"type": "set", "key": "graphics.rate", "value": "10"}',
        '{"type": "set", "key": "delays.a", "value": 2}',
        '{"type": "set", "key": "gains.controller.K_pc", "value": -1}',
        '{"type": "set", "key": "controller.topology", "value": 1}',
        '{"type": "set", "key": "model", "value": "model"}',
        '{"type": "set", "key": "holds.a", "value": 1}',
        '{"type": "set", "key": "holds.a", "value": null}',
        '{"type": "time", "do": "stop"}',
        '{"type": "time", "do": "pause", "b": true}',
        '{"type": "set", "key": "graphics.rate", "value": 10, "b": 1}',
        '{"type": "compare", "on": 1}',
        json.dumps({"type": "set", "key": "holds." + "x" * 201, "value": "zoh"}),
        json.dumps({"type": "set", "key": "holds.x", "value": "z" * 201}),
        b'{"type": "hand", "at": null}',
    ],
)
def test_what_is_no_message_is_refused(text: str | bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse(text)


def test_of_many_messages_the_newest_of_each_control_is_kept() -> None:
    gain = [SetControl("set", f"gains.{name}", float(i)) for i in range(5) for name in "ab"]
    step = [Time("time", "step")] * 2
    pulls = [Hand("hand", at, user) for user in ("", "left") for at in ((0.0, 0.0), None)]
    found = newest([*gain, *step, *pulls])
    assert found == [*gain[-2:], *step, pulls[1], pulls[3]]
