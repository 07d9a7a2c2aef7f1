"""Further users: their blocks and connections, and what a scene may ask of them."""

import hapticlink as hl
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system import haptic_loop

BLOCKS = ("hand", "controller", "haptic_device", "observer", "motor_map")


def test_every_user_has_the_same_connections():
    """The rows of a further user are those of the first one, with the suffix and the prefix."""
    rows = {(w.from_, w.to) for w in haptic_loop.rows(hl.scene("two-users"))}

    def of_left(end):
        fmu, port = end.split(".", 1)
        return f"{fmu}_left.{port}" if fmu in BLOCKS else f"{fmu}.left.{port}"

    first = {r for r in rows if "left" not in r[0] + r[1]}
    own = {r for r in first if any(end.split(".")[0] in BLOCKS for end in r)}
    assert {tuple(map(of_left, r)) for r in own} == rows - first
    assert len(own) == 28


def test_a_user_without_a_controller_of_its_own_has_the_scenes():
    scene = hl.scene("two-users", {"controller.bias": "none"})
    made = {b.name: b.settings for b in blocks(scene).built}
    assert made["controller_left"]["controller"].bias == "none"
    other = hl.scene("two-users", {"controllers.left.topology": False})
    made = {b.name: b.settings for b in blocks(other).built}
    assert made["controller"]["controller"].topology is True
    assert made["controller_left"]["controller"].topology is False


def test_encoders_are_those_of_every_device(tmp_path):
    """Controller and mechanism get each hand's wrench from its own device's observer."""
    options = {"sensing": "encoders", "duration": 0.1}
    run = simulate("two-users", tmp_path, [f"{k}={v}" for k, v in options.items()]).results.run
    booked = run["energies_within_a_rate"]
    for of, at in (("", ""), ("_left", "left.")):
        observed = f"haptic_device{of}.F_hand_observed -> virtual_mechanism.{at}F_hand"
        assert observed in booked
        assert f"controller{of}.F_drift -> virtual_mechanism.{at}F_drift" in booked
