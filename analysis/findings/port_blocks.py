"""The energy generated at the user's port, by the block that generates it.

With works over the mechanism (S) and the handle (D) of each user, `held` those of the wrenches as
they are held and `ideal` those of their sources, linear in the displacement between samples
(energy/meter.py),

    drift        ideal(F_drift on D) + ideal(-F_drift on S)
    topology     ideal(F_T on D)
    environment  ideal(F_env on D) - ideal(F_env on S)
    hold of C    held - ideal, of each connection C that works on the handle or the mechanism
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
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.tracking import of_block, poses, table_of
from hapticlink.analysis.findings.work_of_wrenches import Works
from hapticlink.orchestrator.base.signal_names import (
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    MECHANISM,
    MOTOR_WRENCH,
    TOPOLOGY_WRENCH,
    signal_of_user,
)
from hapticlink.orchestrator.results.tables import Results, Vector


class User(NamedTuple):
    """The signals of a user: poses of the point and the handle, the wrenches on them, and the
    mechanism's inputs `virtual_mechanism.<inputs>F_hand`, F_drift."""

    point: str
    handle: str
    drift: str
    topology: str
    motors: str
    contact: str
    inputs: str


def user(name: str = "") -> User:
    """The signals of the user at a further point; the first user's name is empty."""
    point, handle = poses(name)
    return User(
        point,
        handle,
        drift=signal_of_user(DRIFT_WRENCH, name),
        topology=signal_of_user(TOPOLOGY_WRENCH, name),
        motors=signal_of_user(MOTOR_WRENCH, name),
        contact=signal_of_user(ENVIRONMENT_WRENCH, name),
        inputs=signal_of_user(f"{MECHANISM}.", name),
    )


def needed(results: Results, users: Iterable[str]) -> set[str]:
    """The signals from which the blocks of these users are found, as far as a run has them."""
    signals: set[str] = set()
    for signals_of_user in map(user, users):
        signals |= {
            *signals_of_user[:-1],
            *(source for source, _ in _sources(results, signals_of_user)),
        }
    return signals


def by_block(
    results: Results, works: Works, time: Vector, stored: Vector, put_in: Mapping[str, Vector]
) -> dict[str, Vector]:
    """The energy (J) that each block has generated at the times (s) of a window, those of all
    users' blocks added up. stored: E - E(0) less the work of hands without a device; put_in: the
    work of each user's hand on the handle, by the user's name."""
    blocks: dict[str, Vector] = {}
    shaping, mechanism = np.zeros(len(time)), stored.copy()

    def add(name: str, energy: Vector) -> None:
        blocks[name] = blocks.get(name, 0.0) + energy

    def on(signal: str, position: str) -> tuple[Vector, Vector] | None:
        if of_block(results, signal, 3) is None or of_block(results, position, 3) is None:
            return None
        return works.of(results, signal, position, time)

    for of_user, done in ((user(name), done) for name, done in put_in.items()):
        shaping = shaping - done
        wrenches = {
            "drift": of_user.drift,
            "topology": of_user.topology,
            "environment": of_user.contact,
        }
        for name, signal in wrenches.items():
            if wrench := on(signal, of_user.handle):
                add(name, wrench[1])
                shaping = shaping - wrench[1]
        if motors := on(of_user.motors, of_user.handle):
            add(f"hold of {of_user.motors}", motors[0] - motors[1])
            shaping = shaping - (motors[0] - motors[1])
        if contact := on(of_user.contact, of_user.point):
            add("environment", -contact[1])
            shaping = shaping + contact[1]
        for name, (held, source) in _into_mechanism(results, works, of_user, time).items():
            mechanism = mechanism - held
            if name == of_user.drift:
                add("drift", source)
                add(f"hold of {name} on the mechanism", held - source)
            else:
                shaping = shaping + held
    return {"shaping": shaping, **blocks, "mechanism": mechanism}


def _into_mechanism(
    results: Results, works: Works, of_user: User, time: Vector
) -> dict[str, tuple[Vector, Vector]]:
    """Held and ideal work (J) on a user's point of what F_hand and F_drift of the mechanism come
    from, by that signal."""
    ports = {}
    for source, target in _sources(results, of_user):
        if table_of(results, source) and of_block(results, of_user.point, 3):
            sign = -1.0 if target.endswith("F_drift") else 1.0
            name = f"{source} -> {target}"
            ports[source] = works.of(results, source, of_user.point, time, sign, name)
    return ports


def _sources(results: Results, of_user: User) -> Iterator[tuple[str, str]]:
    """Where F_hand and F_drift of the mechanism come from, and that input."""
    for name in results.record.meters:
        source, _, target = name.partition(" -> ")
        if target in (f"{of_user.inputs}F_hand", f"{of_user.inputs}F_drift"):
            yield source, target
