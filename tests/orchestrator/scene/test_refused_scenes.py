"""What a scene, or an option for it, is refused for, in its own words and at its place: one row
(options, message) each. The later rows of a scene are faults of its system: connections and holds,
coupling, what happens at given times. Several faults of one file, with their lines, are in
test_scene.py."""

import shlex

import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene import read_and_check
from tests.orchestrator.scene.test_scene import GOOD
from tests.orchestrator.systems import system_of

ARM = GOOD[: GOOD.index("wrench")] + (
    'type = "arm"\nmass = [1.0, 1.0, 0.002]\ntarget = [[0.0, 0.0, 0.0, 0.0]]\n'
)
LIMITS = "linkage.joint.pivot.limits={stiffness=9.0, lower=1.0"
DRIVE = "linkage.joint.pivot.drive={type='pd',effort=1,table=[[0,0]],stiffness=1,damping=1}"
FOUR = "[[0,0],[1,0],[0.1,0.1],[0,1]]"
OUT = "is out of range: give a"
THREE = "should be three numbers"
NO_POWER = "no connection across rates carries power"
NOTHING = "is no connection of this scene; did you mean 'controller.P_c'?"
X_D = '"controller.x_D"'
ITERATED = f"coupling=iterated; at=[{{time=0.1, freeze=[{X_D}]}}]"
LATE = "hold=pspm; delays.controller.x_D=0.004"
REFUSED = {
    "the scene of test_scene.py": [
        ("duration=0.001", "0.001 s is less than a haptic period, 1/(512 Hz)"),
        ('power=[{effort="a.F", displacement="a.x", sign=0.5}]', "0.5 is no sign: write 1 or -1"),
        ("directions.hysteresis=10", "10.0 times rank_tolerance = 0.1 is 1"),
        ("device.base_y_a=0.3", "a device is a linkage now: base joints are at `at_parent`"),
        ("device.torque_limit=0.1", "a device is a linkage now: write device.motor.torque_limit"),
        ("device.extends=twinn", "neither a file nor a shipped device; did you mean 'twin'?"),
        ("device.body.crankk.mass=1.0", "no entry 'crankk'; did you mean 'crank'?"),
        ("device.body.a_right_distal.like=distal", "'distal' is no body that says its own"),
        ("device.joint.a_elbow_left.parent=a_left", "no body 'a_left'"),
        ("device.handle.body=knob", "no body 'knob'"),
        ("device.joint.a_left.range=[1.0, 0.5]", "1.0 is not below 0.5: give both ends"),
        ("device.handle={ body = 'crank', along = [1.0, 0.0] }", "is one direction of the plane"),
        ("device.base=[0.1]", "1 fault\n  --set 'device.base=[0.1]': device.base[1]: is missing"),
        ("device.motor.ratio=0", "ratio = 0 is a motor that moves nothing"),
        ("device.motor={ inertia = 1e-5 }", "give its motor a torque_limit (N.m)"),
        ("device.sensing=encoders", "write `sensing` outside of [device]"),
        ("sensing=encoder", "--set sensing=encoder: sensing: 'encoder' should be 'ideal'"),
        ("stop_when=hand.F[1] < nan", "write a signal against a number"),
        ("stop_when='x = 3'", "stop_when: 'x = 3': write a signal"),
        ("linkage.family=n-four-bar; linkage.n=1001", ">= 1 and <= 1000"),
        ("linkage.body.0.mass=-1", "--set linkage.body.0.mass=-1: linkage.body[0] (bar).mass"),
        ("linkage.body.bar.mass=inf", "linkage.body[0] (bar).mass: inf is out of range: give"),
        ("linkage.body.bar.mass=-1.0", "give a number >= 0 (kg)"),
        ("linkage.joint.pivot.parent=bar", "linkage.body[0] (bar): its joints run in a circle"),
        ("linkage.operational_point.body=rod", "no body 'rod'; there are bar"),
        ("linkage.start.pvot=0.5", "linkage.start.pvot: no joint 'pvot'; did you mean 'pivot'"),
        ("graphics.rate={ min = 60, max = 10 }", "swap them"),
        ("graphics.rate=[0.5, 0.2]", "must rise"),
        ("controller.topology=3", "controller.topology: 3 should be a table or true or false"),
        ("controller.topology.stif=3", "controller.topology.stif: unknown"),
        ("fmu.+={ name = 'w', block = 'virtual_wall', settings = { stiffness = 9.0 }, "
         "tolerance = 1e-3 }",
         "is for a solver in a file"),
        ("duration.x=1", "--set duration.x=1: duration: {'x': 1} should be"),
        ("novalue", "--set novalue"),
        ("=3", "--set =3"),
        ("linkage.body.bax.mass=1", "--set linkage.body.bax.mass=1"),
        *((f"hand={value}", "hand") for value in ("3", "'x'", "[1.0]")),
    ],
    "an arm": [
        ("hand.mass=0.5", f"hand.mass: 0.5 {THREE} (kg, kg, kg.m2)"),
        ("hand.mass=[1,2,3,4]", f"[1, 2, 3, 4] {THREE} (kg, kg, kg.m2)"),
        ("hand.target=1", "hand.target: 1 should be a list of rows of four numbers"),
        ("hand.type=sprin", "hand.type: no type 'sprin'; did you mean 'spring'?"),
        ("hand.type=x", "hand.type: no type 'x'; there are constant, profile, arm, spring"),
        ("hand.type=spring", "`mass` belongs to type 'arm' or 'fingertip', not 'spring'"),
        ("hand.wrench=[1,2,3]", "hand.wrench: `wrench` belongs to type 'constant', not 'arm'"),
        ("haptic.rate=1", "haptic: unknown key; did you mean 'haptics'?"),
        ("haptics.rate=nan", f"haptics.rate: nan {OUT} finite number > 0 and"),
        ("duration=inf", f"duration: inf {OUT} finite number > 0 and"),
        ("controller.teleoperation.stiffness=100",
         f"controller.teleoperation.stiffness: 100 {THREE} (N/m, N/m, N.m/rad)"),
        ("get_after_set=m", "get_after_set: 'm' should be a list of texts"),
        ("delays.a.b={ min = 0.1, max = 0.2, los = 0.05, seed = 3 }",
         "delays.a.b.los: unknown key; did you mean 'loss'?"),
        ('delays."a.b"={ los = 0.05 }', "delays.a.b.los: unknown key; did you mean 'loss'?"),
        (DRIVE, "drive.effort: `effort` belongs to type 'constant', not 'pd'"),
    ],
    "closed-loop-ideal": [
        ("device.motor.inertia=-1e-3", f"device.motor.inertia: -0.001 {OUT} number >= 0 (kg.m2)"),
        ("device.encoder.resolution=-1", f"device.encoder.resolution: -1 {OUT} number > 0 (rad"),
        ("device.observer.omega_n=-5", f"device.observer.omega_n: -5 {OUT} number > 0 (rad/s)"),
        ("device.observer={ law = 'kalman', k_D = 50.0 }",
         "device.observer.k_D: is of law = 'nicosia', and law = 'kalman' has no such key: take it"),
        ("device.observer={ law = 'kalman', rule = 'forward' }", "device.observer.rule: is of law"),
        ("device.stop.reach=5", f"device.stop.reach: 5 {OUT} number > 0.5 and < 1"),
        ("directions.rank_tolerance=7", f"directions.rank_tolerance: 7 {OUT} number > 0 and < 1"),
        ("graphics.stiffness=[-1,-1,-1]", f"graphics.stiffness[2]: -1 {OUT} number >= 0 (N.m/rad)"),
        ("controller.damping=[-1,-1,-1]", f"controller.damping[0]: -1 {OUT} number >= 0 (N.s/m)"),
        ("controller.passivity.limit=2.0", "passivity.limit"),
        ("controller.passivity.limit=0.0", "passivity.limit"),
        ("controller.passivity.noise=0.0", "passivity.noise"),
        ("controller.contact=true", "there is nothing to touch: add [contacts]"),
        ("haptics.rate=5e-324", "less than a haptic period"),
        ("graphics.phase=0.05", "graphics.phase: 0.05 s: the first step ends within a period"),
        ("graphics.phase=0", f"graphics.phase: 0 {OUT} number > 0"),
        ("graphics.phase=0.01; graphics.rate={min=10, max=60}", "needs a fixed rate"),
        ("graphics.phase='now'", "graphics.phase: 'now' should be a number (s)"),
        ("graphics.rate={trace='none.csv'}", "cannot be read as a trace"),
        ("phases.virtual_mechanism=0", f"phases.virtual_mechanism: 0 {OUT} number > 0"),
        ("phases.controller=0.002", "phases.controller: 0.002 s: the first step ends within a per"),
        ("phases.virtual_mechansm=0.001",
         "phases.virtual_mechansm: no FMU 'virtual_mechansm'; did you mean 'virtual_mechanism'?"),
        ("phases.controller='soon'", "phases.controller: 'soon' should be a number (s)"),
        ("phases.virtual_environment=0.01; graphics.rate={ min = 10, max = 60 }",
         "phases.virtual_environment: a phase needs a fixed rate"),
        ("delays.hand.F=-1.0", "-1.0 is out of range: give a number >= 0 and <= 100000 (s)"),
        ("delays.hand.F={loss=1.5}", "1.5 is out of range: give a number >= 0 and <= 1"),
        ("downsampling=zoh", "there are model, latest, mean"),
        ("iteration.most=0", "iteration.most"),
        ("iteration.tolerance=-1.0", "iteration.tolerance"),
        ("step_control={ tolerance = 1.0 }", "with a higher rate or `substeps`"),
        ("faults.discard=retry", "faults.discard: a step that an FMU discards ends the run"),
        ("record.signals=some", '"all", "connected" or "none", a list of texts or a table (Hz)'),
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
         "'rotation' should be 'projector', 'semidefinite', 'angle', 'table', 'count' or 'none'"),
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
            ('set={"graphics.rte"=15}', "graphics.rate alone can be set"),
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
    "four-bar": [
        (f"{'a.' * 300}a=1", "a key of 301 names"),
        (f"a={'[' * 60_000}", "a"),
        (f"linkage.start.x={'[' * 31}{']' * 31}", "write it flatter"),
        (" . " * 40_000, "write key=value"),
        (f"linkage.gravity=[0.0, 1{'0' * 400}]", "a whole number of more than 64 bits"),
        (f"duration=1{'0' * 5000}", "should be a valid number"),
        ("duration=2020-01-01", "2020-01-01 should be a number"),
        ("duration=\udcff", r"'\udcff' is no Unicode text"),
        ("\udcff=1", "is no Unicode text"),
        ("linkage.body.².mass=1", "no entry '²'"),
        (f"linkage.body.{'9' * 5000}.mass=1", "no entry '999"),
    ],
    "enclosure": [
        ("contacts.enclosure=[[0.0, 0.0], [1.0, 0.0]]", "2 corners"),
        (f"contacts.enclosure={FOUR}", "not convex at"),
        ("linkage.body.link1.radius=0.0", "give a number > 0 (m)"),
        ("linkage.body.link1.capsule=[[0.0, 0.0], [0.0, 0.0]]", "two different"),
        ("contacts.stiffness=-1.0", "give a number >= 0 (N/m)"),
        ("contacts.detection=hapics", "'graphics' or 'haptics'"),
        ("contacts={friction=0.3, stiffness=0.0}", "cannot stick"),
        ("contacts.friction=-0.3", "give a number >= 0"),
        *((f"contacts.enclosure={corners}", "contacts") for corners in (
            "[[0, 0], [1, 0], [1, 0], [0, 1]]", "[[0, 0]]", "[]", "[[0, 0], [0, 0], [0, 0]]")),
    ],
    "obstacles": [
        ("contacts.disc.pin.name=block", "'block' is taken"),
        ("contacts.disc.pin.radius=0.0", "give a number > 0 (m)"),
        *((f"contacts.polygon.0.corners={corners}", "contacts") for corners in (
            "[[0, 0], [1, 0], [1, 0], [0, 1]]", "[[0, 0]]", "[]", "[[0, 0], [0, 0], [0, 0]]")),
    ],
    "push-disc": [
        ("linkage.body.disc.name=block", "'block' is taken"),
        ("contacts={bodies='none'}", "there is nothing to touch"),
        (f"linkage.body.block.corners={FOUR}", "not convex at"),
        ("linkage.body.block.capsule=[[0,0],[1,0]]", "leave out one of them"),
        ("linkage.body.block.center=[0.01, 0.0]", "give its `inertia` too"),
        ("contacts={detection='graphics'}; graphics.sync=operational",
         "nothing pulls the copy of 'block' along"),
    ],
    "n-four-bar": [
        ("linkage.n=0", "linkage.n: 0 is out of range: give a whole number >= 1"),
        ("linkage.n=2.5", "2.5 is out of range: give a whole number >= 1"),
        ("linkage.family=n-four-bars", "did you mean 'n-four-bar'"),
    ],
    "pendulum": [
        ("linkage.joint.pivot.limits={stiffness=9.0}", "give `lower`, `upper` or both"),
        ("linkage.joint.pivot.axis=0.5",
         'axis: a revolute joint has no direction: leave it out, or type = "prismatic"'),
        ("linkage.joint.pivot.type=prismatic", "axis: a prismatic joint needs its direction (rad)"),
        (f"{LIMITS}, upper=-1.0}}", "-1.0 is not above `lower` = 1.0"),
        (f"{LIMITS}, restitution=0.5, damping=0.1}}", "`damping` or `restitution`, not both"),
        (f"{LIMITS}, restitution=0.0}}", "give a number >= 0.01"),
        ("coupling=iterated", "'iterated' repeats the steps of connected plants"),
        ("linkage.joint.0.friction_speed=1e-6; duration=0.01", "virtual_mechanism: the "
         "`friction_speed` or `friction_deflection` of a joint is too fast for steps of 0.00"),
    ],
    "single-body": [
        ("linkage.joint.float.limits={stiffness=9.0, lower=1.0}",
         "a free joint has three coordinates"),
    ],
    "scotch-yoke": [
        ("linkage.loop.0.type=revolute",
         'axis: a revolute joint has no direction: leave it out, or type = "slot" or "prismatic"'),
        ("linkage.loop.0.angle=0.5",
         'angle: a slot joint has no angle: leave it out, or type = "prismatic"'),
    ],
    "two-hands": [
        ("hands.right={wrench=[0.0, 0.0, 0.0]}", "no point 'right'; there are left"),
        ("linkage.point.left.body=link9", "no body 'link9'"),
    ],
    "two-users": [
        ("devices.right={}", "no point 'right'; there are left"),
        ("controllers.left={}; devices={}", "add [devices.left]"),
        ("devices.left.base_y_a=1.0", "a device is a linkage now"),
    ],
    "local-model": [
        ("mechanism.stabilization=projection", "take 'baumgarte'"),
        ("mechanism_at=graphics", "runs at the graphics rate itself"),
    ],
}  # fmt: skip
SEVERAL = (
    "graphics.rate=[0.5, 0.2]", "hand.type=spring", "graphics.stiffness=[-1,-1,-1]",
    "controller.damping=[-1,-1,-1]", "contacts={friction=0.3, stiffness=0.0}",
    "contacts.enclosure=[]", "linkage.body.disc.name=block", ITERATED, LATE,
    "device.motor={ inertia = 1e-5 }", "device.motor.ratio=0",
)  # fmt: skip
"""These make further faults."""
IN_THE_FILE = (
    "device.motor={ inertia = 1e-5 }", "device.motor.ratio=0",
    "linkage.joint.pivot.parent=bar", "hand.type=spring",
    "haptics.rate=5e-324", "\udcff=1", "contacts.disc.pin.name=block", "mechanism_at=graphics",
    "linkage.body.disc.name=block", "linkage.body.block.center=[0.01, 0.0]",
    "linkage.joint.0.friction_speed=1e-6; duration=0.01", "linkage.joint.pivot.type=prismatic",
    "linkage.loop.0.type=revolute",
)  # fmt: skip
"""The faults of these are not told at the option."""
TEXTS = {"the scene of test_scene.py": GOOD, "an arm": ARM}


def refused(scene: object, *options: str) -> str:
    """What is said of a scene: one of TEXTS, or by its name or path."""
    text = TEXTS.get(str(scene))
    with pytest.raises(InputFault) as fault:
        read_and_check.read_scene(text, options) if text else system_of(scene, *options)
    assert fault.value.exit_status == 2
    return str(fault.value)


@pytest.mark.parametrize(
    ("scene", "options", "message"),
    [(scene, *row) for scene, rows in REFUSED.items() for row in rows],
    ids=lambda value: str(value)[:40],
)
def test_what_is_refused(scene, options, message):
    said = refused(scene, *options.split("; "))
    assert message in said
    assert (" faults\n" in said) == (options in SEVERAL)
    assert ("--set" in said) == (options not in IN_THE_FILE)
    assert len(said) < 1000


@pytest.mark.parametrize(
    "value", ["1e308", "'1e99999999'", "'1e-99999999'", "'1e+09999'", "nan", "'1/0'", "1e400", "0"]
)
@pytest.mark.parametrize("key", ["haptics.rate", "graphics.rate", "duration", "graphics.phase"])
def test_rates_and_times_out_of_any_range(key, value):
    option = f"{key}={value}"
    assert f"--set {shlex.quote(option)}: {key}: " in refused("closed-loop-ideal", option)


def test_a_key_that_is_gone_says_what_to_do() -> None:
    with pytest.raises(InputFault, match="are left out, to the same result: take it out"):
        open_scene.load("obstacles", ["contacts.broad_phase=false"])


@pytest.mark.parametrize(
    "asked",
    ["at=[{time=0.1, set={'drill.u'=1.0}}]", "substeps={drill=2}", "get_after_set=['drill']",
     "record.signals=['drill.y']", "stop_when='drill.y > 1.0'"],
)  # fmt: skip
def test_what_names_an_fmu_that_cannot_be_read_is_not_denied_besides(tmp_path, asked):
    (tmp_path / "drill.fmu").write_text("no zip")
    drill = f"fmu.+={{name='drill', path='{tmp_path}/drill.fmu'}}"
    assert asked.partition("=")[0] in refused("closed-loop-ideal", asked)
    said = refused("closed-loop-ideal", drill, asked)
    assert "not a readable zip archive" in said
    assert " faults" not in said
