"""Haptic device: twin pantograph, four motors, four encoders and the observer.

    M_d(x) v' + C_d(x, v) v = J_q' (tau + friction) + F_hand + stops        (4.5)

tau, the torques of least norm for F_motor at the pose measured at t_k, saturated, is held over the
communication step [t_k, t_k + h). A device without friction has no terms of it. At t = 0 the handle
is at rest at x_start and the observed force is zero.

Without encoders x, v and F_hand_observed are the true values. With them x is the pose that belongs
to the quantised base angles; v and F_hand_observed come from the observer. M and c = C_d v are
evaluated at the measured pose and velocity, workspace_margin at the true pose. All dimensions are
assumed, since the report gives only the 0.09 degrees of an encoder count.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components import integrators
from hapticlink.components.component import Block, Component, Variability, Variable
from hapticlink.components.device import pantograph
from hapticlink.components.device.motors_and_encoders import quantised
from hapticlink.components.device.observer import ForceObserver, State
from hapticlink.components.parts import BlockPart
from hapticlink.components.port_space import PLANE
from hapticlink.components.ports import Power
from hapticlink.components.specs.device import Device

_FIXED = (
    ("proximal_length", "m", "length of the link next to each motor"),
    ("distal_length", "m", "length of the link between elbow and crank end"),
    ("crank", "m", "length of the crank between the two planes"),
    ("base_x", "m", "x midway between the base joints"),
    ("base_half_width", "m", "half the distance between the base joints of a plane"),
    ("base_y_a", "m", "y of the base joints of plane A, below the workspace"),
    ("base_y_b", "m", "y of the base joints of plane B, above the workspace"),
    ("rotor_inertia", "kg.m2", "inertia of each motor's rotor"),
    ("proximal_mass", "kg", "mass of each proximal link"),
    ("proximal_center", "m", "its centre of mass from the base joint"),
    ("proximal_inertia", "kg.m2", "its inertia about the centre of mass"),
    ("distal_mass", "kg", "mass of each distal link"),
    ("distal_center", "m", "its centre of mass from the elbow"),
    ("distal_inertia", "kg.m2", "its inertia about the centre of mass"),
    ("handle_mass", "kg", "mass of handle and crank"),
    ("handle_inertia", "kg.m2", "inertia of handle and crank"),
)
_FRICTION = (
    ("motor_damping", "N.m.s/rad", "viscous damping about each motor's axis"),
    ("motor_friction", "N.m", "dry friction about each motor's axis"),
)
_TUNABLE = (
    ("torque_limit", "N.m", "largest torque of a motor"),
    ("reach_limit", "1", "fraction of an arm's length at which its stop begins"),
    ("stop_stiffness", "N/m", "stiffness of the stops"),
    ("stop_damping", "N.s/m", "damping of the stops"),
)


SPACE = PLANE
"""Of the port at the handle."""
_POWER = Power("x_true")
_INPUTS = [
    Variable("F_motor", *SPACE.wrench, 0.0, "desired wrench of the motors", power=_POWER),
    Variable("F_hand", *SPACE.wrench, 0.0, "wrench of the hand on the handle", power=_POWER),
]
_OUTPUTS = [
    Variable("x", *SPACE.pose, description="measured pose of the handle"),
    Variable("v", *SPACE.twist, description="measured velocity of the handle", derivative_of="x"),
    Variable("F_hand_observed", *SPACE.wrench, description="observed wrench of the hand"),
    Variable("M", *SPACE.inertia, 0.0, "inertia of the device at the handle", kind="semidefinite"),
    Variable("c", *SPACE.wrench, description="C_d v, Coriolis and centrifugal terms at the handle"),
    Variable(
        "workspace_margin",
        (),
        "m",
        0.0,
        "smallest distance of an arm to a stop, negative beyond it",
    ),
    Variable("x_true", *SPACE.pose, description="true pose of the handle"),
    Variable("v_true", *SPACE.twist, 0.0, "true velocity of the handle", derivative_of="x_true"),
]
_STATES = [
    Variable("x_true", *SPACE.pose, description="pose of the handle"),
    Variable("v_true", *SPACE.twist, description="velocity of the handle"),
]
_SENSED_STATES = [
    Variable("x_measured", *SPACE.pose, description="pose from the encoders"),
    Variable("x_observer", *SPACE.pose, description="observer state x1"),
    Variable("v_observer", *SPACE.twist, description="observer state x2"),
]


def _parameters(device: Device, sensed: bool) -> list[Variable]:
    def of(rows: tuple[tuple[str, str, str], ...], variability: Variability) -> list[Variable]:
        return [Variable(n, (), u, getattr(device, n), d, variability) for n, u, d in rows]

    start = Variable("x_start", *SPACE.pose, 0.0, "pose of the handle at the start", "fixed")
    parameters = [start, *of(_FIXED, "fixed"), *of(_TUNABLE, "tunable")]
    if device.motor_damping or device.motor_friction:
        parameters += of(_FRICTION, "tunable")
    if sensed:
        parameters += of((("encoder_resolution", "rad", "angle of one encoder count"),), "fixed")
        gains = device.observer
        parameters += [
            Variable("omega_n", (), "rad/s", gains.omega_n, "bandwidth of the observer"),
            Variable("k_D", (), "1/s", gains.k_D, "output gain of the observer"),
        ]
    return parameters


def _plant(block: Block) -> ca.Function:
    """(x = [pose, v], u = [tau, F_hand], p, t) -> x' of (4.5)."""
    state, drive = ca.SX.sym("x", 6), ca.SX.sym("u", 7)
    pose, v, tau, F_hand = state[:3], state[3:], drive[:4], drive[4:]
    M, c = pantograph.motion(pose, v, block.p)
    J = pantograph.jacobian(pose, block.p)
    if "motor_friction" in block.p:
        tau = tau + pantograph.friction_torques(J @ v, block.p)
    wrench = J.T @ tau + F_hand
    wrench += pantograph.stop_wrench(pose, v, block.p) - c
    derivative = ca.vertcat(v, ca.solve(M, wrench))
    return ca.Function("ode", [state, drive, block.p.vector, block.t], [derivative])


def advance_device(block: Block, tau: ca.SX, substeps: int) -> ca.SX:
    """[x_true, v_true] after h, with the torques tau and the hand's wrench held."""
    plant, h, inputs = _plant(block), block.h / substeps, ca.vertcat(tau, block.u["F_hand"])
    motion = ca.vertcat(block.x["x_true"], block.x["v_true"])
    for i in range(substeps):
        t = block.t + i * block.h / substeps
        motion = integrators.step("heun", plant, motion, inputs, block.p.vector, t, h, [0, 1, 2])
    return motion


class _Encoders:
    """Encoders and observer: the pose, velocity and wrench that they measure at t_k."""

    def __init__(self, block: Block, rule: str) -> None:
        self._p, self._h, x = block.p, block.h, block.x
        self._observer = ForceObserver(rule, block.p["omega_n"], block.p["k_D"])
        self._state = State(x["x_observer"], x["v_observer"])
        self.pose = x["x_measured"]
        self._M, self._C = pantograph.dynamics(self.pose, self._state.x2, block.p)
        self.velocity = self._observer.velocity(self._state, self.pose)
        self.F_hand = self._observer.force(self._state, self.pose, self._M)

    def _measure(self, true_pose: ca.SX, guess: ca.SX) -> ca.SX:
        """The pose that belongs to the counted base angles."""
        angles = pantograph.base_angles(true_pose, self._p)
        counted = quantised(angles, self._p["encoder_resolution"], 0.5)
        return pantograph.pose_from_angles(counted, guess, self._p)

    def initial(self) -> dict[str, ca.SX]:
        pose = self._measure(self._p["x_start"], self._p["x_start"])
        return {"x_measured": pose, "x_observer": pose, "v_observer": ca.SX.zeros(SPACE.size)}

    def step(self, true_pose: ca.SX, tau: ca.SX) -> dict[str, ca.SX]:
        """The states after h, at the end of which the handle is at true_pose."""
        pose = self._measure(true_pose, self.pose)
        F_motor = pantograph.jacobian(self.pose, self._p).T @ tau
        matrices = self._M, self._C
        after = self._observer.step(self._state, self.pose, pose, F_motor, *matrices, self._h)
        return {"x_measured": pose, "x_observer": after.x1, "v_observer": after.x2}


_MATRICES = BlockPart("inertia", r"$M_d(x),\ c = C_d(x, v)\,v$", "(4.5)", ("x", "v"), ("M", "c"))
_IDEAL = BlockPart(
    "ideal sensing", r"$x = x_D,\ v = v_D$", "",
    ("x_true", "v_true", "F_hand"), ("x", "v", "F_hand_observed"),
)  # fmt: skip
_SENSED = (
    BlockPart(
        "encoders", r"$x = \arg\min_x \|\varphi(x)$" "\n" r"$- \Delta\,[\varphi(x_D) / \Delta]\|$",
        "section 4.2.1, fig. 4.2",
        ("x_true", "encoder_resolution"), ("x", "x_measured"),
    ),
    BlockPart(
        "Nicosia observer",
        r"$\dot{x}_1 = x_2 + k_D e,\ e = x - x_1$" "\n"
        r"$M_d \dot{x}_2 = J_q^T \tau - C_d x_2 + M_d \omega_n^2 e$" "\n"
        r"$v = \dot{x}_1,\ F_h = M_d \omega_n^2 e$",
        "section 4.2.1",
        ("x", "tau", "omega_n", "k_D"), ("v", "F_hand_observed", "x_observer", "v_observer"),
    ),
)  # fmt: skip


def _schematic(block: Block, encoders: bool) -> list[BlockPart]:
    """The parts, in the order of their evaluation."""
    p = block.p
    tau = r"(\tau + \tau_f)" if "motor_friction" in p else r"\tau"
    friction = tuple(name for name, *_ in _FRICTION if name in p)
    stops = ("reach_limit", "stop_stiffness", "stop_damping")
    return [
        BlockPart(
            "motors",
            r"$\tau = J_q^{T+} u$, at most" "\n" r"$|\tau_i| \leq \tau_{max}$",
            "section 4.2.1, fig. 4.2",
            ("F_motor", "x", "torque_limit"), ("tau",),
        ),
        BlockPart(
            "twin pantograph",
            rf"$M_d \dot{{v}} + C_d v = J_q^T {tau}$" "\n" r"$+ F_h + F_{stops}$",
            "(4.5)",
            ("tau", "F_hand", *friction, *stops), ("x_true", "v_true", "workspace_margin"),
        ),
        *(_SENSED if encoders else [_IDEAL]),
        _MATRICES,
    ]  # fmt: skip


def haptic_device(device: Device, encoders: bool = False) -> Component:
    """The device, sensed by encoders and observer where `encoders` says so."""
    block = Block(
        inputs=_INPUTS,
        parameters=_parameters(device, encoders),
        states=[*_STATES, *(_SENSED_STATES if encoders else [])],
        outputs=_OUTPUTS,
    )
    x, u, p = block.x, block.u, block.p
    measured = _Encoders(block, device.observer.rule) if encoders else None
    pose, v, F_hand = (
        (measured.pose, measured.velocity, measured.F_hand)
        if measured
        else (x["x_true"], x["v_true"], u["F_hand"])
    )
    tau = pantograph.motor_torques(u["F_motor"], pose, p)
    motion = advance_device(block, tau, device.substeps)
    initial = {"x_true": p["x_start"], "v_true": ca.SX.zeros(SPACE.size)}
    step = {"x_true": motion[:3], "v_true": motion[3:]}
    if measured:
        initial |= measured.initial()
        step |= measured.step(motion[:3], tau)
    M, c = pantograph.motion(pose, v, p)
    output = {"x": pose, "v": v, "F_hand_observed": F_hand, "M": M, "c": c}
    output |= {"workspace_margin": ca.mmin(pantograph.margins(x["x_true"], p))}
    output |= {name: x[name] for name in ("x_true", "v_true")}
    sensing = "encoders and observer" if encoders else "ideally sensed"
    return block.component(
        "haptic_device",
        f"Twin-pantograph haptic device with motors, {sensing}",
        "continuous",
        initial=initial,
        step=step,
        output=output,
        documentation=__doc__ or "",
        parts=_schematic(block, encoders),
    )
