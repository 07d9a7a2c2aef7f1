"""Haptic device: a linkage with motors and encoders, and the observer.

    M_d(x) v' + C_d(x, v) v = J_q' (tau + friction) + E F_hand + stops        (4.5)

in the directions E of the handle in which the device moves; x, v and all wrenches are those of the
port, of the plane or of a point in space, and 0 in the others (x: as at the start). tau, the
torques of least norm for F_motor at the pose measured at t_k, saturated, is held over the
communication step [t_k, t_k + h). A device without friction has no terms of it. At t = 0 the handle
is at rest at x_start and the observed force is zero.

Without encoders x and v are the true values. With them x is the pose that belongs to the quantised
angles; v and F_hand_observed come from the observer. M and c = C_d v are evaluated at the measured
pose and velocity, workspace_margin at the true pose.

With its observer beside it (block `observer`) the device takes torques tau (block `motor_map`) and
puts out q, the coordinates of its joints by the encoders: counts times resolution; q_true, these
themselves; theta_true, the angles of its motors' axes; and tau_applied, the torques of the step
that ends, 0 at t = 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca

from hapticlink.components import integrators
from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device import observer_laws, variables
from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.device.models import device_model
from hapticlink.components.device.motors_and_encoders import count
from hapticlink.components.device.variables import in_port, seen, start_pose
from hapticlink.components.port_space import PortSpace
from hapticlink.components.ports import Power
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.device import Device

FRICTION = ("motor_damping", "motor_friction")


def _wrench(space: PortSpace, name: str, text: str) -> Variable:
    return Variable(name, *space.wrench, 0.0, text, power=Power("x_true"))


def _of_motors(space: PortSpace) -> Variable:
    return _wrench(space, "F_motor", "desired wrench of the motors")


def _of_hand(space: PortSpace) -> Variable:
    return _wrench(space, "F_hand", "wrench of the hand on the handle")


def _true_outputs(space: PortSpace) -> list[Variable]:
    margin, velocity = (
        "smallest distance to a stop, negative beyond it",
        "true velocity of the handle",
    )
    return [
        Variable("workspace_margin", (), "m", 0.0, margin),
        Variable("x_true", *space.pose, description="true pose of the handle"),
        Variable("v_true", *space.twist, 0.0, velocity, derivative_of="x_true"),
    ]


class _Motion:
    """The names of the states of the motion: x_true and v_true where these are all of the port."""

    def __init__(self, model: DeviceModel) -> None:
        whole = model.is_pose and model.directions.whole
        self.names = ("x_true", "v_true") if whole else ("place", "rate")
        self.states = [
            variables.place(model, self.names[0], "place of the device"),
            variables.felt(model, "twist", self.names[1], "velocity of the handle"),
        ]

    def of(self, block: Block) -> tuple[ca.SX, ca.SX]:
        """Place and velocity."""
        return block.x[self.names[0]], block.x[self.names[1]]


def _angles(model: DeviceModel, name: str, text: str) -> Variable:
    units = tuple(sensed.joint.kind.units[0] for sensed in model.encoders)
    return Variable(name, (len(units),), units, description=text)


def _torques(model: DeviceModel, name: str, text: str, power: Power | None = None) -> Variable:
    return Variable(name, (len(model.motors),), "N.m", 0.0, text, power=power)


def _resolutions(model: DeviceModel) -> Variable:
    units = tuple(sensed.joint.kind.units[0] for sensed in model.encoders)
    values = tuple(sensed.resolution for sensed in model.encoders)
    text = "change of a joint's coordinate by a count"
    return Variable("encoder_resolution", (len(units),), units, values, text, "fixed")


def _parameters(model: DeviceModel, *, torque_limit: bool = True) -> list[Variable]:
    limits = [v for v in model.limits if torque_limit or v.name != "torque_limit"]
    return [start_pose(model.device.space), *model.parameters, *limits]


def _plant(block: Block, model: DeviceModel) -> ca.Function:
    """(x = [place, v], u = [tau, F_hand, omega_f], p, t) -> x' of (4.5)."""
    n, k = len(model.start_place), model.directions.size
    m, w = len(model.motors), model.device.space.size
    state, drive = ca.SX.sym("x", n + k), ca.SX.sym("u", 2 * m + w)
    z, v, tau, F_hand = state[:n], state[n:], drive[:m], model.directions.pick(drive[m : m + w])
    inertia, c = model.motion(z, v, block.p)
    J = model.jacobian(z, block.p)
    if "motor_friction" in block.p:
        tau = tau + model.friction_torques(J @ v, drive[m + w :], block.p)
    force = J.T @ tau + F_hand
    force += model.stop_force(z, v, block.p) - c
    derivative = ca.vertcat(model.rate(z, v, block.p), ca.solve(inertia, force))
    return ca.Function("ode", [state, drive, block.p.vector, block.t], [derivative])


def advance_device(
    block: Block, model: DeviceModel, motion: tuple[ca.SX, ca.SX], tau: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Place and velocity after h, with the torques tau and the hand's wrench held."""
    substeps, n = model.device.substeps, motion[0].numel()
    plant, h, scales = _plant(block, model), block.h / substeps, ca.SX(len(model.motors), 1)
    if "motor_friction" in block.p:
        inertia, _ = model.motion(motion[0], ca.SX(*motion[1].shape), block.p)
        scales = model.friction_scales(model.jacobian(motion[0], block.p), inertia, h, block.p)
    inputs = ca.vertcat(tau, block.u["F_hand"], scales)
    still, both = ca.SX(model.directions.size, 1), ca.vertcat(*motion)
    for i in range(substeps):
        t = block.t + i * block.h / substeps
        both = integrators.step("heun", plant, both, inputs, block.p.vector, t, h, range(n))
        if model.device.loop and not model.is_pose:
            both = ca.vertcat(model.moved(both[:n], still, block.p), both[n:])
    return both[:n], both[n:]


_MATRICES = BlockPart("inertia", r"$M_d(x),\ c = C_d(x, v)\,v$", "(4.5)", ("x", "v"), ("M", "c"))
_IDEAL = BlockPart("ideal sensing", r"$x = x_D,\ v = v_D$", "", ("x_true", "v_true"), ("x", "v"))
_MOTORS = BlockPart(
    "motors",
    r"$\tau = J_q^{T+} u$, at most" "\n" r"$|\tau_i| \leq \tau_{max}$",
    "section 4.2.1, fig. 4.2",
    ("F_motor", "x", "torque_limit"), ("tau",),
)  # fmt: skip
_COUNTED = BlockPart(
    "encoders", r"$q = \Delta\,[\varphi(x_D) / \Delta]$", "section 4.2.1, fig. 4.2",
    ("x_true", "encoder_resolution"), ("q", "counts", "q_true", "theta_true"),
)  # fmt: skip
_NICOSIA = (
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


def _observer_parts(block: Block) -> tuple[BlockPart, ...]:
    """The parts of encoders and observer."""
    if "k_D" in block.p:
        return _NICOSIA
    period = ("step_size",) if "step_size" in block.p else ()
    kalman = BlockPart(
        "Kalman observer",
        r"$M_d \dot{v} = J_q^T \tau - C_d v + F_h,\ \dot{x} = v$" "\n"
        r"$e = (J_q^T J_q)^{-1} J_q^T (q - \varphi(x))$" "\n"
        r"$x, v, F_h \mathrel{+}= g_1 e,\ g_2 e,\ M_d g_3 e$",
        "",
        ("q", "tau", "omega_n", *period),
        ("x", "v", "F_hand_observed", "x_observer", "v_observer", "F_observer"),
    )  # fmt: skip
    return replace(_COUNTED, gives=("q",)), kalman


def _motion_part(block: Block, motion: _Motion) -> BlockPart:
    """The part of the motion."""
    p = block.p
    tau = r"(\tau + \tau_f)" if "motor_friction" in p else r"\tau"
    friction = tuple(name for name in FRICTION if name in p)
    stops = ("stop_reach", "stop_stiffness", "stop_damping")
    applied = ("tau_applied",) if "tau_applied" in block.x else ()
    gives = dict.fromkeys((*motion.names, "x_true", "v_true", "workspace_margin", *applied))
    return BlockPart(
        "device",
        rf"$M_d \dot{{v}} + C_d v = J_q^T {tau}$" "\n" r"$+ F_h + F_{stops}$",
        "(4.5)",
        ("tau", "F_hand", *friction, *stops),
        (*gives,),
    )


def haptic_device(device: Device, encoders: bool = False) -> Component:
    """The device, sensed by encoders where `encoders` says so, with the observer of these in it or
    beside it."""
    model = device_model(device)
    if not encoders:
        return _ideal(model)
    return _without_observer(model) if device.observer.beside else _with_observer(model)


def _ideal(model: DeviceModel) -> Component:
    """The device whose pose and velocity are known."""
    motion, space = _Motion(model), model.device.space
    block = Block(
        inputs=[_of_motors(space), _of_hand(space)],
        parameters=_parameters(model),
        states=motion.states,
        outputs=[*seen(space, force=False), *_true_outputs(space)],
    )
    z, v = motion.of(block)
    tau = model.motor_torques(model.directions.pick(block.u["F_motor"]), z, block.p)
    inertia, c = model.motion(z, v, block.p)
    known = {"x": model.handle(z, block.p), "v": v, "M": inertia, "c": c}
    parts = [_MOTORS, _motion_part(block, motion), _IDEAL, _MATRICES]
    made = _Made(block, model, motion, "ideally sensed", parts)
    return made.component({}, made.moved(tau), known)


def _with_observer(model: DeviceModel) -> Component:
    """The device with encoders and observer."""
    motion, space = _Motion(model), model.device.space
    block = Block(
        inputs=[_of_motors(space), _of_hand(space)],
        parameters=[
            *_parameters(model),
            _resolutions(model),
            *observer_laws.parameters(model),
        ],
        states=[*motion.states, *observer_laws.states(model)],
        outputs=[*seen(space, force=True), *_true_outputs(space)],
    )
    u, p = block.u, block.p
    observer = observer_laws.observer(model, p)
    now = observer.read(block.x)
    known = observer.outputs(now)
    tau = model.motor_torques(model.directions.pick(u["F_motor"]), now.place, p)
    parts = [_MOTORS, _motion_part(block, motion), *_observer_parts(block), _MATRICES]
    made = _Made(block, model, motion, "encoders and observer", parts)
    moved, guess = made.moved(tau), model.place_at_pose(p["x_start"], p)
    first = observer.start(made.measured(guess)[0], guess)
    after = observer.advance(now, made.measured(moved[motion.names[0]])[0], tau, block.h)
    return made.component(first.states, moved | after.states, known)


def _without_observer(model: DeviceModel) -> Component:
    """The device with encoders, whose observer is a block of its own."""
    motion, space = _Motion(model), model.device.space
    block = Block(
        inputs=[
            _torques(model, "tau", "torques of the motors", Power("theta_true")),
            _of_hand(space),
        ],
        parameters=[*_parameters(model, torque_limit=False), _resolutions(model)],
        states=[*motion.states, _torques(model, "tau_applied", "torques of the step before")],
        outputs=[
            _angles(model, "q", "joint coordinates by the encoders: counts x resolution"),
            Variable("counts", (len(model.encoders),), "1", description="counts of the encoders"),
            _torques(model, "tau_applied", "torques of the step that ends"),
            _angles(model, "q_true", "true joint coordinates"),
            Variable("theta_true", (len(model.motors),), "rad", description="true motor angles"),
            *_true_outputs(space),
        ],
    )
    z, tau = motion.of(block)[0], block.u["tau"]
    made = _Made(block, model, motion, "encoders", [_motion_part(block, motion), _COUNTED])
    angles, counts = made.measured(z)
    output = {"q": angles, "counts": counts, "tau_applied": block.x["tau_applied"]}
    output |= {"q_true": model.angles(z, block.p), "theta_true": model.motor_angles(z, block.p)}
    initial = {"tau_applied": ca.SX.zeros(tau.numel())}
    return made.component(initial, made.moved(tau) | {"tau_applied": tau}, {}, output)


class _Made:
    """A device with what is the same however it is sensed: its start, and its true motion."""

    def __init__(
        self,
        block: Block,
        model: DeviceModel,
        motion: _Motion,
        sensing: str,
        parts: Sequence[BlockPart],
    ) -> None:
        self._block, self._model, self._motion = block, model, motion
        self._sensing, self._parts = sensing, parts

    def measured(self, place: ca.SX) -> tuple[ca.SX, ca.SX]:
        """The joint coordinates at a place by the encoders, and the counts of these."""
        p = self._block.p
        return count(self._model.angles(place, p), p["encoder_resolution"])

    def moved(self, tau: ca.SX) -> dict[str, ca.SX]:
        """The states of the motion after h."""
        motion = self._motion.of(self._block)
        after = advance_device(self._block, self._model, motion, tau)
        return dict(zip(self._motion.names, after, strict=True))

    def component(
        self,
        initial: Mapping[str, ca.SX],
        step: Mapping[str, ca.SX],
        known: Mapping[str, ca.SX],
        output: Mapping[str, ca.SX] | None = None,
    ) -> Component:
        """The device with further initial values and steps of states, what is `known` along the
        directions that are felt, and further outputs."""
        block, model = self._block, self._model
        p, directions = block.p, model.directions
        z, v = self._motion.of(block)
        true = {
            "x_true": directions.pose(model.handle(z, p), p["x_start"]),
            "v_true": directions.put(v),
            "workspace_margin": model.least_margin(z, p),
        }
        start = model.place_at_pose(p["x_start"], p), ca.SX.zeros(directions.size)
        at_rest = dict(zip(self._motion.names, start, strict=True))
        return block.component(
            "haptic_device",
            f"Haptic device with motors, {self._sensing}",
            "continuous",
            initial={**at_rest, **initial},
            step=step,
            output={**in_port(directions, known, p["x_start"]), **(output or {}), **true},
            documentation=__doc__ or "",
            parts=self._parts,
        )
