"""The names that results and views look up are those of the FMUs."""

from collections.abc import Iterator

from hapticlink.api.runs import with_board
from hapticlink.components.blocks import BLOCKS
from hapticlink.orchestrator.base import signal_names
from hapticlink.orchestrator.base.signal_names import block_of_user, signal_of_user, user_of_block
from hapticlink.orchestrator.scene.overrides import write_options
from tests.orchestrator.systems import system_of
from tests.visualization.live_page.test_controls import POINTS


def _constants() -> Iterator[str]:
    for name, value in vars(signal_names).items():
        if name.isupper():
            yield from (value,) if isinstance(value, str) else value


def _variables(scene: str, options: tuple[str, ...]) -> Iterator[str]:
    for fmu in system_of(scene, *options).fmus:
        yield from (
            f"{fmu.name}.{s.port}" for s in fmu.description.scalars if s.causality != "input"
        )


SCENES = {
    "closed-loop-ideal": POINTS,
    "closed-loop": ("device.observer.beside=true",),
    "obstacles": ("mechanism.directions=true", "controller.passivity=true"),
    "pendulum": ("mechanism.integrator=passive-midpoint",),
    "closed-loop-2diy": write_options(with_board("/dev/ttyACM0")),
}


def test_every_name_is_a_block_or_an_output_or_parameter_of_one():
    known = {*BLOCKS, *(name for item in SCENES.items() for name in _variables(*item))}
    missing = sorted({*_constants()} - known)
    assert not missing, missing


def test_names_of_users():
    assert block_of_user("controller", "left") == "controller_left"
    assert block_of_user("virtual_mechanism", "left") == "virtual_mechanism"
    assert signal_of_user("controller.F_drift", "left") == "controller_left.F_drift"
    assert signal_of_user("virtual_mechanism.F_env", "left") == "virtual_mechanism.left.F_env"
    assert signal_of_user("virtual_mechanism.F_env", "") == "virtual_mechanism.F_env"
    assert user_of_block("hand_left", "hand") == "left"
    assert user_of_block("hand", "hand") == ""
    assert user_of_block("handle", "hand") is None
    assert user_of_block("my_hand_left", "hand") is None
