"""What the system of a shipped scene is refused for, one row (options, message) each: connections
and holds, coupling, what happens at given times. What the scene alone tells is in
scene/test_refused_scenes.py."""

import pytest

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate

NO_POWER = "no connection across rates carries power"
NOTHING = "is no connection of this scene; did you mean 'controller.P_c'?"
X_D = '"controller.x_D"'
ITERATED = f"coupling=iterated; at=[{{time=0.1, freeze=[{X_D}]}}]"
LATE = "hold=pspm; delays.controller.x_D=0.004"
SEVERAL = (ITERATED, LATE)
"""These make two faults."""
REFUSED = {
    "closed-loop": [
        ("hold=passive", NO_POWER),
        ("hold=nepce", NO_POWER),
        ("hold=pspm", "no held connection sets a spring"),
        ("hold=pspm", "closed-loop-direct"),  # where it does
        ("holds.virtual_environment.P_c=passive", "not a declared power connection"),
        ("holds.virtual_environment.P_c=foh-derivative", "does not put out the derivative of P_c"),
        ("holds.controller.nothing=foh", "is no connection of this scene"),
        ('holds."controller.P_d"=lead', NOTHING),
        ("delays.controller.P_d=0.1", NOTHING),
        ("holds.zzz=lead", "there are hand.F -> haptic_device.F_hand, "),
        ("substeps.hand=4", "is no plant of this scene"),
        ("get_after_set=['hand']", "is no plant of this scene"),
        ('kinds."virtual_mechanism.x"=projector', "x has 3 entries, and a projector"),
        ("kinds.virtual_mechanism.x=rotation",
         "'rotation' should be 'projector', 'semidefinite', 'angle', 'table' or 'none'"),
        ('record.signals=["virtual_mechanism.xx"]', "did you mean 'virtual_mechanism.x'?"),
        ("duration=1e5; graphics.rate={ min = 20, max = 60 }", "graphics.rate: up to 5688888 p"),
        (ITERATED, "steps are repeated"),
        ("at=[{time=0.1}]", "nothing happens then"),
        *((f"at=[{{time=0.1, {what}}}]", message) for what, message in (
            ('set={"hand.wrench"=[0.0]}', "1 values for the 3"),
            ('set={"hand.wrenc"=[0.0]}', "no input or parameter 'wrenc'"),
            (f"set={{{X_D}=[0.0, 0.0, 0.0]}}", "take override"),
            ('set={"haptic_device.x_start"=[0.0, 0.0, 0.0]}', "x_start"),
            ('set={"graphics.rate"=1000}', "give a rate"),
            ('override={"controller.k_j"=0.0}', "take set"),
            ('override={"virtual_mechanism.F_hand"=[0.0, 0.0, 0.0]}', "carries power"),
            ('freeze=["nobody.x"]', "no FMU 'nobody'"),
            (f"until=0.05, freeze=[{X_D}]", "is not after"),
            (f"noise={{{X_D}=0.0}}", "noise"),
        )),
    ],
    "closed-loop-direct": [
        ("holds.virtual_mechanism.F_drift=pspm", "sets no spring"),
        ("holds.controller.x_S=pspm", "controller.v_S sets the same spring"),
        ("holds.controller.v_S=pspm", "controller.x_S sets the same spring"),
        (LATE, "near end of its spring must be read unheld"),
    ],
    "pendulum": [
        ("coupling=iterated", "'iterated' repeats the steps of connected plants"),
        ("linkage.joint.0.friction_speed=1e-6; duration=0.01", "virtual_mechanism: the "
         "`friction_speed` or `friction_deflection` of a joint is too fast for steps of 0.00"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "options", "message"),
    [(scene, *row) for scene, rows in REFUSED.items() for row in rows],
    ids=lambda value: str(value)[:40],
)
def test_what_is_refused(tmp_path, scene, options, message):
    with pytest.raises(InputFault) as refused:
        simulate(scene, tmp_path / "out", options.split("; "))
    assert message in str(refused.value)
    assert "--set" in str(refused.value) or message.startswith("virtual_mechanism: ")
    assert "2 faults" not in str(refused.value) or options in SEVERAL
