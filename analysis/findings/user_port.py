"""Energy at the user's port: what the rendering has stored beyond what the hands put in.

The handle shall move as the mechanism would in the hand. So the hand's work on the handle, and that
of further hands on the mechanism, should be what the mechanism has gained:

    generated(t) = E(t) - E(0) - sum F_hand . dx_D - sum F_k . dx_k

summed over the users with a device each, and over hands k at further points, with E the mechanism's
energy (kinetic, of gravity, springs and contacts) and each force, as it acts, paired with the
displacement of the step that it acts over. A positive value is energy that the hand could get back
without having put it in; friction makes it negative, drives positive. `port_blocks.py` tells which
block it comes from.

`works` are of single wrenches: on each handle of its hand, its motors, F_T, F_env; of F_env on the
mechanism; and of what a mobility held from another rate adds to the motors' wrench,
M_d (Lambda_held^-1 - Lambda^-1) (F_h + F_drift + F_env): no force crosses a rate there, but a held
mobility modulates power. It needs the mechanism's own (`mechanism.directions`) and a hold of `zoh`.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.port_blocks import by_block, find_motor_port, needed_signals
from hapticlink.analysis.findings.tracking import (
    FIRST,
    UserSignals,
    compared_directions,
    find_users,
    have_one_shape,
    newest,
    of_any_shape,
    of_block,
    of_port,
    path_of_point,
    rows_until,
    table_of,
)
from hapticlink.analysis.findings.work_of_wrenches import (
    Works,
    absolute_work,
    last,
    work_as_held,
    work_of_source,
)
from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    HANDLE_INERTIAS,
    HANDLE_POSE,
    MECHANISM,
    MECHANISM_ENERGY,
    MOBILITIES,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results, Table, Vector
from hapticlink.orchestrator.results.run_record import BlockEnergy, PortEnergy

NOTICEABLE_J = 1e-3
"""Energy (J) of a handle of 0.1 kg that vibrates by 1 mm at 20 Hz, or that of one of 0.3 kg at
8 cm/s."""
SHARE = 0.25
"""Of the hand's work, which a rendering may generate."""


class UserPort(NamedTuple):
    """Work of the hands and energy generated (J) at times (s), the mechanism's samples; that of
    each block, of which the latter is the sum; the works of single wrenches at the last of them
    (J), by name; and that of the hands until then, its absolute values summed (J)."""

    time_s: Vector
    put_in_J: Vector
    generated_J: Vector
    blocks_J: dict[str, Vector]
    works: dict[str, float]
    hand_work_J: float

    @property
    def measured(self) -> PortEnergy:
        """What run.json says of it."""
        peak = int(np.argmax(self.generated_J))
        return PortEnergy(
            generated=float(self.generated_J[-1]),
            peak=float(self.generated_J[peak]),
            time_of_peak=float(self.time_s[peak]),
            blocks={
                name: BlockEnergy(float(energy[-1]), float(energy.max()))
                for name, energy in self.blocks_J.items()
            },
            works=self.works,
            hand_work=self.hand_work_J,
        )


def tolerated_energy(hand_work: float) -> float:
    """The energy (J) that a rendering may generate where the hand works so much (J)."""
    return max(NOTICEABLE_J, SHARE * hand_work)


def allowance(hand_work: float, whose: str = "the hand") -> str:
    """What is tolerated, in words, for `whose` work."""
    most = f"{short(1e3 * tolerated_energy(hand_work))} mJ"
    if SHARE * hand_work < NOTICEABLE_J:
        return f"{most}, the least that a hand notices"
    return f"{most}, a quarter of the {short(1e3 * hand_work)} mJ that {whose} gave and took back"


def hand_work(results: Results) -> float:
    """The work (J) of the hands on their handles, its absolute values summed; none of a user whose
    pose or wrench is missing, or has another rate."""
    moved = ((of_port(results, user.handle), user) for user in find_users(results))
    return sum((absolute_work(t, u.hand, u.handle) for t, u in moved if t and u.hand in t), 0.0)


@np.errstate(over="ignore", invalid="ignore")  # of a run that diverged
def user_port(results: Results, works_too: bool = True) -> UserPort | None:
    """The energy at the user's port; None without hand, handle and mechanism, where something else
    than its hand pushes a handle, or where the work of another hand is not recorded. Without all
    signals that its blocks need there are none. works_too: whether to find the works of single
    wrenches and that of the hands, which else are none and NaN."""
    mechanism, device = of_block(results, MECHANISM_ENERGY), of_port(results, HANDLE_POSE)
    if mechanism is None or device is None or of_port(results, HAND_WRENCH) is None:
        return None
    if find_other_pushes(results) or not (len(device["time"]) and len(mechanism["time"])):
        return None
    rows = rows_until(mechanism, device["time"][-1])
    time = mechanism["time"]
    time = time if rows.stop == len(time) else time[rows]
    works = Works(results, time)
    put_in = {FIRST: works.of(HAND_WRENCH, HANDLE_POSE)[0]}
    further: Vector | float = 0.0
    for name in results.record.connections:
        hand, _, target = name.partition(" -> ")
        point = target.removesuffix(".F_hand").removeprefix(f"{MECHANISM}.")
        if target != f"{MECHANISM}.{point}.F_hand":
            continue
        user, position = UserSignals.of(point), f"{MECHANISM}.{point}.x"
        if with_device := user.handle.partition(".")[0] in results.record.fmus:
            hand, position = user.hand, user.handle
        moved, pushing = of_port(results, position), table_of(results, hand)
        if moved is None or pushing is None or pushing.shape(hand) != PLANE.pose.shape:
            return None
        done = works.of(hand, position)[0]
        if with_device:
            put_in[user] = done
        else:
            further = further + done
    stored = mechanism[MECHANISM_ENERGY]
    stored = stored[rows] - float(stored[0]) - further
    lacks = needed_signals(results, put_in) & {*results.record.not_recorded}
    blocks = {} if lacks else by_block(results, works, stored, put_in)
    on_handles: Vector = sum(put_in.values(), start=np.zeros(len(time)))
    generated, hands = stored - on_handles, on_handles + further
    single = (_works(results, works, device, time), hand_work(results)) if works_too else ({}, nan)
    return UserPort(time, hands, generated, blocks, *single)


def find_other_pushes(results: Results) -> list[str]:
    """The connections to handles from other sources than the hands of their users."""
    users = find_users(results)
    return [
        name
        for name in results.record.connections
        for user in users
        if name.endswith(f" -> {user.handle.partition('.')[0]}.F_hand")
        and not name.startswith(f"{user.hand} ")
    ]


def _works(results: Results, works: Works, device: Table, time: Vector) -> dict[str, float]:
    """The works (J) of single wrenches on the handles at the last of some times, those of further
    users named by their points, and of contacts on the mechanism."""
    found = {
        f"{user.name}: {name}" if user.name else name: works.last(signal, moved)
        for user in find_users(results)
        for name, (signal, moved) in {
            "hand": (user.hand, user.handle),
            "motors": find_motor_port(results, user),
            "F_T": (user.topology, user.handle),
            "F_env": (user.environment, user.handle),
        }.items()
        if have_one_shape(results, signal, moved)
    }
    if contact := of_port(results, ENVIRONMENT_WRENCH):
        path = path_of_point(results, FIRST)
        done = work_of_source(time, contact, ENVIRONMENT_WRENCH, contact, path)
        found["F_env on the mechanism"] = last(done)
    if (added := _hold_mobility(results, device)) is not None:
        done = work_as_held(time, added.__getitem__, device["time"], device, HANDLE_POSE)
        found["held mobility"] = last(done)
    return found


def _hold_mobility(results: Results, device: Table) -> Vector | None:
    """What holding the mobility adds to the motors' wrench, (n, 3) at the device's samples; None
    where it is not held, or not by zoh, or the mechanism's own is not put out."""
    held, own = (of_block(results, signal, *PLANE.mobility.shape) for signal in MOBILITIES)
    crossing = f"{MOBILITIES[0]} -> {CONTROLLER}.Lambda_inv"
    if (compared := compared_directions(results)) is not None and compared[2, 2]:
        return None  # of an angle that is fixed the mobility is another one
    if not held or own is not device or results.record.holds.get(crossing) != "zoh":
        return None
    inertias = (signal for signal in HANDLE_INERTIAS if of_any_shape(results, signal) is device)
    inertia_of_handle = next(inertias, None)
    if inertia_of_handle is None:
        return None
    mobility = held[MOBILITIES[0]]
    signals = [s for s in (DRIFT_WRENCH, ENVIRONMENT_WRENCH) if s in device]

    def added(time: Vector, own: Vector, inertia: Vector, hand: Vector, *others: Vector) -> Vector:
        change = mobility[newest(held, time)] - own
        wrench = sum(others, start=hand)
        force: Vector = np.einsum("kij,kjl,kl->ki", inertia, change, wrench)
        return force.T

    asked = "time", MOBILITIES[1], inertia_of_handle, HAND_WRENCH, *signals
    return np.ascontiguousarray(device.by_row(added, *asked).T)
