"""Haptic device: twin pantograph, four motors, four encoders and the observer.

    M_d(x) v' + C_d(x, v) v = J_q' tau + F_hand + stops        (4.5)

tau, the torques of least norm for F_motor at the pose measured at t_k, saturated, is held over the
communication step [t_k, t_k + h).
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components import integrators
from hapticlink.components.component import (
    INERTIA,
    POSE,
    TWIST,
    WRENCH,
    Block,
    Component,
    Variability,
    Variable,
)
from hapticlink.components.device import observer, pantograph
from hapticlink.components.ports import Power
from hapticlink.components.quantisation import quantised
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
_TUNABLE = (
    ("torque_limit", "N.m", "largest torque of a motor"),
    ("reach_limit", "1", "fraction of an arm's length at which its stop begins"),
    ("stop_stiffness", "N/m", "stiffness of the stops"),
    ("stop_damping", "N.s/m", "damping of the stops"),
)


def _parameters(device: Device, encoders: bool) -> list[Variable]:
    def of(rows: tuple[tuple[str, str, str], ...], variability: Variability) -> list[Variable]:
        return [Variable(n, (), u, getattr(device, n), d, variability) for n, u, d in rows]

    start = Variable("x_start", (3,), POSE, 0.0, "pose of the handle at the start", "fixed")
    parameters = [start, *of(_FIXED, "fixed"), *of(_TUNABLE, "tunable")]
    if encoders:
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
    wrench = pantograph.jacobian(pose, block.p).T @ tau + F_hand
    wrench += pantograph.stop_wrench(pose, v, block.p) - c
    derivative = ca.vertcat(v, ca.solve(M, wrench))
    return ca.Function("ode", [state, drive, block.p.vector, block.t], [derivative])


def haptic_device(device: Device, encoders: bool = False) -> Component:
    """The FMU `haptic_device`, with the parameters of `device`.

    Without `encoders`, x, v and F_hand_observed are the true values. With them, x is the pose that
    belongs to the quantised base angles, v and F_hand_observed come from the observer. M and
    c = C_d v are evaluated at the measured pose and velocity, workspace_margin at the true pose.
    All dimensions are assumed, since the report only gives the 0.09 degrees of an encoder count.
    At t = 0 the handle is at rest at x_start and the observed force is zero.
    """
    states = [
        Variable("x_true", (3,), POSE, description="pose of the handle"),
        Variable("v_true", (3,), TWIST, description="velocity of the handle"),
    ]
    if encoders:
        states += [
            Variable("x_measured", (3,), POSE, description="pose from the encoders"),
            Variable("x_observer", (3,), POSE, description="observer state x1"),
            Variable("v_observer", (3,), TWIST, description="observer state x2"),
        ]
    block = Block(
        inputs=[
            Variable(
                "F_motor",
                (3,),
                WRENCH,
                description="desired wrench of the motors",
                power=Power("x_true"),
            ),
            Variable(
                "F_hand",
                (3,),
                WRENCH,
                description="wrench of the hand on the handle",
                power=Power("x_true"),
            ),
        ],
        parameters=_parameters(device, encoders),
        states=states,
        outputs=[
            Variable("x", (3,), POSE, description="measured pose of the handle"),
            Variable(
                "v", (3,), TWIST, description="measured velocity of the handle", derivative_of="x"
            ),
            Variable("F_hand_observed", (3,), WRENCH, description="observed wrench of the hand"),
            Variable(
                "M",
                (3, 3),
                INERTIA,
                description="inertia of the device at the handle",
                kind="semidefinite",
            ),
            Variable(
                "c", (3,), WRENCH, description="C_d v, Coriolis and centrifugal terms at the handle"
            ),
            Variable(
                "workspace_margin",
                (),
                "m",
                description="smallest distance of an arm to a stop, negative beyond it",
            ),
            Variable("x_true", (3,), POSE, description="true pose of the handle"),
            Variable(
                "v_true",
                (3,),
                TWIST,
                description="true velocity of the handle",
                derivative_of="x_true",
            ),
        ],
    )
    x, u, p, t, h = block.x, block.u, block.p, block.t, block.h
    pose, velocity = x["x_true"], x["v_true"]

    measured = x["x_measured"] if encoders else pose
    tau = pantograph.motor_torques(u["F_motor"], measured, p)
    plant, motion = _plant(block), ca.vertcat(pose, velocity)
    for i in range(device.substeps):
        motion = integrators.step(
            "heun",
            plant,
            motion,
            ca.vertcat(tau, u["F_hand"]),
            p.vector,
            t + i * h / device.substeps,
            h / device.substeps,
            [0, 1, 2],
        )
    step = {"x_true": motion[:3], "v_true": motion[3:]}
    initial = {"x_true": p["x_start"], "v_true": ca.SX.zeros(3)}

    if encoders:

        def measure(true_pose: ca.SX, guess: ca.SX) -> ca.SX:
            angles = pantograph.base_angles(true_pose, p)
            counted = quantised(angles, p["encoder_resolution"], 0.5)
            return pantograph.pose_from_angles(counted, guess, p)

        x1, x2 = x["x_observer"], x["v_observer"]
        M, C = pantograph.dynamics(measured, x2, p)
        at_start, at_end = measure(p["x_start"], p["x_start"]), measure(motion[:3], measured)
        F_motor = pantograph.jacobian(measured, p).T @ tau
        after = observer.step(
            device.observer.rule,
            x1=x1,
            x2=x2,
            pose=measured,
            pose_next=at_end,
            F_motor=F_motor,
            M=M,
            C=C,
            omega_n=p["omega_n"],
            k_D=p["k_D"],
            period=h,
        )
        step |= {"x_measured": at_end, "x_observer": after.x1, "v_observer": after.x2}
        initial |= {"x_measured": at_start, "x_observer": at_start, "v_observer": ca.SX.zeros(3)}
        v = observer.velocity(x1=x1, x2=x2, pose=measured, k_D=p["k_D"])
        F_hand = observer.force(x1=x1, pose=measured, M=M, omega_n=p["omega_n"])
    else:
        v, F_hand = velocity, u["F_hand"]

    M, c = pantograph.motion(measured, v, p)
    output = {
        "x": measured,
        "v": v,
        "F_hand_observed": F_hand,
        "M": M,
        "c": c,
        "workspace_margin": ca.mmin(pantograph.margins(pose, p)),
        "x_true": pose,
        "v_true": velocity,
    }
    return block.component(
        "haptic_device",
        "Twin-pantograph haptic device with motors"
        + (", encoders and observer" if encoders else ", ideally sensed"),
        "continuous",
        initial=initial,
        step=step,
        output=output,
        documentation=haptic_device.__doc__ or "",
    )
