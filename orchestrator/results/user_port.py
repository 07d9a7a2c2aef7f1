"""Energy at the user's port: what the rendering has stored beyond what the hands put in.

The handle shall move as the mechanism would in the hand. So the hand's work on the handle, and that
of further hands on the mechanism, should be what the mechanism has gained:

    generated(t) = E(t) - E(0) - sum F_hand . dx_D - sum F_k . dx_k

summed over the users with a device each, and over hands k at further points, with E the
mechanism's energy (kinetic, of gravity, springs and contacts) and each force paired with the
displacement of the step that it acts over. It is the sum of three parts, of works at the end:

    hand         of the users' wrenches on the mechanism, less the same on their handles
    coupling     of -F_drift of all users on the mechanism
    mechanism    what is left: friction, damping and contacts, drives, and the error of integration

A positive value is energy that the hand could get back without having put it in; friction makes it
negative, drives positive.

`works` are of single wrenches: on the handle of the hand, the motors, F_T, F_env; of F_env on the
mechanism; and of what a mobility held from another rate adds to the motors' wrench,
M_d (Lambda_held^-1 - Lambda^-1) (F_h + F_drift + F_env): no force crosses a rate there, but a held
mobility modulates power. It needs the mechanism's own (`mechanism.directions`) and a hold of `zoh`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hapticlink.orchestrator.results.tables import Results, Table, Vector
from hapticlink.orchestrator.results.tracking import (
    DEVICE,
    MECHANISM,
    further_users,
    of_block,
    poses,
    table_of,
)

BLOCK, MOBILITY, HAND = "virtual_mechanism", "Lambda_inv", "hand.F"
ENERGY, POINT, CONTACT = f"{BLOCK}.energy", f"{BLOCK}.F_hand", f"{BLOCK}.F_env"


class UserPort(NamedTuple):
    """Energy generated (J) at times (s), the mechanism's samples; its parts and the works of single
    wrenches at the end (J), by name."""

    time_s: Vector
    generated_J: Vector
    parts: dict[str, float]
    works: dict[str, float]

    @property
    def told(self) -> dict[str, Any]:
        """For run.json."""
        peak = int(np.argmax(self.generated_J))
        found = {"generated": self.generated_J[-1], "peak": self.generated_J[peak]}
        found |= {"time_of_peak": self.time_s[peak]}
        return {k: float(v) for k, v in found.items()} | {"parts": self.parts, "works": self.works}


def user_port(results: Results) -> UserPort | None:
    """The energy at the user's port; None without hand, handle and mechanism."""
    mechanism, device = of_block(results, ENERGY), of_block(results, DEVICE, 3)
    if mechanism is None or device is None or (hands := of_block(results, HAND, 3)) is None:
        return None
    if not len(device["time"]) or not len(mechanism["time"]):
        return None
    time = mechanism["time"]
    time = time[time <= device["time"][-1]]
    energy = mechanism[ENERGY][: len(time)]
    stored = energy - energy[0]
    put_in = _work(hands[HAND], hands["time"], device, DEVICE, time)
    booked = _booked(results)
    into = {n: w for n, w in booked.items() if " -> virtual_mechanism." in n}
    hand = into.get(f"{_wrench(into)} -> {POINT}", 0.0)
    coupling = sum(w for n, w in into.items() if n.endswith(".F_drift"))
    further = sum(into.values()) - hand - coupling
    others, on_handle = np.zeros(len(time)), float(put_in[-1])
    users = further_users(results)
    for name in (n for n in into if n.endswith(".F_hand") and not n.endswith(f"-> {POINT}")):
        point = name.rpartition(" -> ")[2].removesuffix(".F_hand").removeprefix(f"{BLOCK}.")
        source = f"hand_{point}.F"
        moved = poses(point)[1] if point in users else f"{BLOCK}.{point}.x"
        table, hand_s = of_block(results, moved, 3), table_of(results, source)
        if table and hand_s:
            work = _work(hand_s[source], hand_s["time"], table, moved, time)
            others += work
            if point in users:
                hand, on_handle = hand + into[name], on_handle + float(work[-1])
                further -= into[name]
    parts = {
        "hand": hand - on_handle,
        "coupling": coupling,
        "mechanism": float(stored[-1]) - hand - coupling - further,
    }
    return UserPort(time, stored - put_in - others, parts, _works(results, device, time))


def _works(results: Results, device: Table, time: Vector) -> dict[str, float]:
    """The works (J) of single wrenches on the handle, and of contacts on the mechanism."""
    signals = {
        "hand": HAND,
        "motors": "controller.F_motor",
        "F_T": "controller.F_constraint",
        "F_env": CONTACT,
    }
    found = {
        name: float(_work(table[signal], table["time"], device, DEVICE, time)[-1])
        for name, signal in signals.items()
        if (table := of_block(results, signal, 3))
    }
    if contact := of_block(results, CONTACT, 3):
        force = contact[CONTACT]
        mean = np.concatenate([(force[:-1] + force[1:]) / 2, force[-1:]])
        on = _work(mean, contact["time"], contact, MECHANISM, time)
        found["F_env on the mechanism"] = float(on[-1])
    if (added := _held_mobility(results, device)) is not None:
        found["held mobility"] = float(_work(added, device["time"], device, DEVICE, time)[-1])
    return found


def _held_mobility(results: Results, device: Table) -> Vector | None:
    """What holding the mobility adds to the motors' wrench, (n, 3) at the device's samples; None
    where it is not held, or not by zoh, or the mechanism's own is not put out."""
    held, own = (of_block(results, f"{b}.{MOBILITY}", 3, 3) for b in ("virtual_environment", BLOCK))
    crossing = f"virtual_environment.{MOBILITY} -> controller.{MOBILITY}"
    if not held or own is not device or results.run["holds"].get(crossing) != "zoh":
        return None
    rows = np.searchsorted(held["time"], device["time"] + 1e-12, "right") - 1
    change = held[f"virtual_environment.{MOBILITY}"][rows] - device[f"{BLOCK}.{MOBILITY}"]
    wrench = device[HAND]
    for signal in ("controller.F_drift", CONTACT):
        wrench = wrench + device[signal] if signal in device else wrench
    added: Vector = np.einsum("kij,kjl,kl->ki", device["haptic_device.M"], change, wrench)
    return added


def _booked(results: Results) -> dict[str, float]:
    """The work (J) of the held effort of each connection that carries power."""
    across = results.run.get("energies", "none")
    within = results.run.get("energies_within_a_rate", {})
    booked = ({} if across == "none" else across) | within
    return {name: energy["held"] for name, energy in booked.items()}


def _wrench(into: dict[str, float]) -> str:
    """What the mechanism's F_hand comes from: the hand, or the device's observer."""
    return next((n.partition(" -> ")[0] for n in into if n.endswith(f"-> {POINT}")), HAND)


def _work(force: Vector, stamps: Vector, moved: Table, position: str, at: Vector) -> Vector:
    """The work (J) of the newest of the forces (n, 3), stamped `stamps`, over the steps of a
    position until the times `at`."""
    x, time = moved[position], moved["time"]
    rows = np.searchsorted(stamps, time[:-1] + 1e-12, "right") - 1
    held = force[np.maximum(rows, 0)]
    work = np.concatenate([[0.0], (held * np.diff(x, axis=0)).sum(axis=1).cumsum()])
    return np.interp(at, time, work)
