"""The energy generated at the user's port, by the block that generates it.

With works over the mechanism (S) and the handle (D) of each user, `held` those of the wrenches as
they are held and `ideal` those of their sources, linear in the displacement between samples
(energy/meter.py),

    drift        ideal(F_drift on D) + ideal(-F_drift on S)
    topology     ideal(F_T on D)
    environment  ideal(F_env on D) - ideal(F_env on S)
    hold of C    held - ideal, of each connection C that works on the handle or the mechanism, or on
                 the motors where these take torques (the observer is beside the device)
    shaping      F_hand on S - F_hand on D + ideal(F_env on S) - ideal(F_drift + F_T + F_env on D)
                 - the holds in it
    mechanism    E - E(0) - held works on S

The sum is E - E(0) - F_hand on D. In an ideal rendering the handle has the motion and the kinetic
energy of the operational point, and all are 0 but what springs and dampers store and lose: drift
then is that of a spring-damper, mechanism that of friction, drives and the error of integration.
Shaping is what the device, shaped by M_d Lambda^-1, has taken less than the mechanism was given: by
a mobility or directions that are held or differ, velocity terms left out, saturation and stops.

Works on the handle and the mechanism are those of the energy meters, of the wrenches as they act:
a sample that comes late, by a latency or in the order of Jacobi, or is lost is paired with the
displacement over which it acts (`work_of_wrenches.py`). Where a hold gives other values than
samples, the work is known at the meter's last sample alone, and reached there in proportion to that
of the samples.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from hapticlink.analysis.findings.tracking import (
    UserSignals,
    have_one_shape,
    of_port,
    path_of_point,
    table_of,
)
from hapticlink.analysis.findings.work_of_wrenches import Works
from hapticlink.orchestrator.base.signal_names import (
    MOTOR_ANGLES,
    MOTOR_TORQUES,
    signal_of_user,
)
from hapticlink.orchestrator.results.read_results import Results, Vector


def _wrenches(user: UserSignals) -> dict[str, str]:
    """By block, its wrench on the handle."""
    return {"drift": user.drift, "topology": user.topology, "environment": user.environment}


def find_motor_port(results: Results, user: UserSignals) -> tuple[str, str]:
    """By what the motors of a user's device work, and over what: torques over angles of a device
    that takes torques, else the motors' wrench over the pose of the handle."""
    torques, angles = (signal_of_user(s, user.name) for s in (MOTOR_TORQUES, MOTOR_ANGLES))
    device = angles.partition(".")[0]
    taken = f"{torques} -> {device}.tau" in results.record.meters
    return (torques, angles) if taken else (user.motors, user.handle)


def needed_signals(results: Results, users: Iterable[UserSignals]) -> set[str]:
    """The signals from which the blocks of these users are found, as far as a run has them."""
    signals: set[str] = set()
    for user in users:
        own = path_of_point(results, user), user.handle, *_wrenches(user).values()
        signals |= {*find_motor_port(results, user)}
        signals |= {*own, *(source for source, _ in _sources(results, user))}
    return signals


def by_block(
    results: Results, works: Works, stored: Vector, put_in: Mapping[UserSignals, Vector]
) -> dict[str, Vector]:
    """The energy (J) that each block has generated at the times of the works, those of all users'
    blocks added up. stored: E - E(0) less the work of hands without a device; put_in: the
    work of each user's hand on the handle."""
    blocks: dict[str, Vector] = {}
    shaping, mechanism = np.zeros(len(stored)), stored.copy()

    def add(name: str, energy: Vector) -> None:
        blocks[name] = np.add(blocks.get(name, 0.0), energy, out=energy)

    def ideal(signal: str, position: str) -> Vector | None:
        there = of_port(results, signal) and of_port(results, position)
        return works.of(signal, position)[1] if there else None

    def made_by_hold(signal: str, position: str) -> Vector | None:
        there = have_one_shape(results, signal, position)
        return np.subtract(*works.of(signal, position)) if there else None

    for user, done in put_in.items():
        point = path_of_point(results, user)
        shaping -= done
        for name, signal in _wrenches(user).items():
            if (energy := ideal(signal, user.handle)) is not None:
                shaping -= energy
                add(name, energy)
        motors = find_motor_port(results, user)
        if (energy := made_by_hold(*motors)) is not None:
            shaping -= energy
            add(f"hold of {motors[0]}", energy)
        if (energy := ideal(user.environment, point)) is not None:
            shaping += energy
            add("environment", np.negative(energy, out=energy))
        for source, target in _sources(results, user):
            if not (table_of(results, source) and of_port(results, point)):
                continue
            sign = -1.0 if target.endswith("F_drift") else 1.0
            held, energy = works.of(source, point, sign, f"{source} -> {target}")
            mechanism -= held
            if source == user.drift:
                held -= energy
                add("drift", energy)
                add(f"hold of {source} on the mechanism", held)
            else:
                shaping += held
    return {"shaping": shaping, **blocks, "mechanism": mechanism}


def _sources(results: Results, user: UserSignals) -> Iterator[tuple[str, str]]:
    """Where F_hand and F_drift of the mechanism at a user's point come from, and that input."""
    inputs = user.point.removesuffix("x")
    for name in results.record.meters:
        source, _, target = name.partition(" -> ")
        if target in (f"{inputs}F_hand", f"{inputs}F_drift"):
            yield source, target
