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

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.port_blocks import by_block, needed
from hapticlink.analysis.findings.tracking import (
    further_users,
    of_block,
    table_of,
    until_last,
)
from hapticlink.analysis.findings.work_of_wrenches import Works
from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    DEVICE,
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    HANDLE_INERTIA,
    HANDLE_POSE,
    MECHANISM,
    MECHANISM_ENERGY,
    MOBILITIES,
    MOTOR_WRENCH,
    TOPOLOGY_WRENCH,
    block_of_user,
    signal_of_user,
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


def user_port(results: Results) -> UserPort | None:
    """The energy at the user's port in the whole run, as `ports`."""
    found = [port for port in ports(results) if port]
    if len(found) < 2:
        return found[0] if found else None
    *_, last = found
    return UserPort(
        np.concatenate([port.time_s for port in found]),
        np.concatenate([port.put_in_J for port in found]),
        np.concatenate([port.generated_J for port in found]),
        {name: np.concatenate([p.blocks_J[name] for p in found]) for name in last.blocks_J},
        last.works,
        last.hand_work_J,
    )


def allowed(hand_work: float) -> float:
    """The energy (J) that a rendering may generate where the hand works so much (J)."""
    return max(NOTICEABLE_J, SHARE * hand_work)


def allowance(hand_work: float) -> str:
    """What is `allowed`, in words."""
    most = f"{short(1e3 * allowed(hand_work))} mJ"
    if SHARE * hand_work < NOTICEABLE_J:
        return f"{most}, the least that a hand notices"
    return f"{most}, a quarter of the {short(1e3 * hand_work)} mJ that the hand gave and took back"


def hand_work(results: Results) -> float:
    """The work (J) of the hands on their handles, its absolute values summed; none of a user whose
    pose or wrench is missing, or has another rate."""
    works = Works()
    return deque((_hand_work(window, works) for window in results.windows()), maxlen=1).pop()


def tolerated(results: Results) -> float:
    """What is `allowed` (J) in a run."""
    return allowed(hand_work(results))


def _hand_work(window: Results, works: Works) -> float:
    """The same until the end of a window."""
    total = 0.0
    for user in ("", *further_users(window)):
        pose, wrench = signal_of_user(HANDLE_POSE, user), signal_of_user(HAND_WRENCH, user)
        moved = of_block(window, pose, 3)
        if moved and wrench in moved:
            total += works.absolute(window, wrench, pose)
    return total


def measured(windows: Iterable[UserPort | None]) -> PortEnergy | None:
    """What run.json says of the energy at the user's port, of the windows of a run."""
    found: PortEnergy | None = None
    for port in windows:
        if port and len(port.time_s):
            now = port.measured
            found = now if found is None else _later(found, now)
    return found


def _later(before: PortEnergy, now: PortEnergy) -> PortEnergy:
    """Of two windows that follow each other."""
    highest = max(before, now, key=lambda each: each.peak)
    return replace(
        now,
        peak=highest.peak,
        time_of_peak=highest.time_of_peak,
        blocks={
            name: replace(block, peak=max(block.peak, before.blocks[name].peak))
            for name, block in now.blocks.items()
        },
    )


def ports(results: Results) -> Iterator[UserPort | None]:
    """The energy at the user's port, window by window; None without hand, handle and mechanism,
    where something else than its hand pushes a handle, or where the work of another hand is not
    recorded. Without all signals that its blocks need there are none."""
    if results.number == 1:
        yield _port(results, Works(whole=True), _energy_at_start(results))
        return
    works, start = Works(), 0.0
    for i, window in enumerate(results.windows()):
        start = _energy_at_start(window) if i == 0 else start
        if _port(window, works, start) is None:
            yield from (None for _ in results.windows())
            return
    works.again()
    for window in results.windows():
        yield _port(window, works, start)


def _energy_at_start(window: Results) -> float:
    mechanism = of_block(window, MECHANISM_ENERGY)
    energies = mechanism[MECHANISM_ENERGY] if mechanism else np.zeros(0)
    return float(energies[0]) if len(energies) else 0.0


@np.errstate(over="ignore", invalid="ignore")  # of a run that diverged
def _port(window: Results, works: Works, start: float) -> UserPort | None:
    mechanism, device = of_block(window, MECHANISM_ENERGY), of_block(window, HANDLE_POSE, 3)
    if mechanism is None or device is None or of_block(window, HAND_WRENCH, 3) is None:
        return None
    if pushed_by_others(window) or not (len(device["time"]) and len(mechanism["time"])):
        return None
    rows = until_last(window.within(mechanism["time"]), mechanism, device)
    time = mechanism["time"][rows]
    stored = mechanism[MECHANISM_ENERGY][rows] - start
    put_in = {"": works.of(window, HAND_WRENCH, HANDLE_POSE, time)[0]}
    further = np.zeros(len(time))
    for name in window.record.connections:
        hand, _, target = name.partition(" -> ")
        point = target.removesuffix(".F_hand").removeprefix(f"{MECHANISM}.")
        if target != f"{MECHANISM}.{point}.F_hand":
            continue
        if with_device := block_of_user(DEVICE, point) in window.record.fmus:
            hand, position = signal_of_user(HAND_WRENCH, point), signal_of_user(HANDLE_POSE, point)
        else:
            position = f"{MECHANISM}.{point}.x"
        moved, pushing = of_block(window, position, 3), table_of(window, hand)
        if moved is None or pushing is None or pushing[hand].shape[1:] != PLANE.pose.shape:
            return None
        done = works.of(window, hand, position, time)[0]
        if with_device:
            put_in[point] = done
        else:
            further += done
    generated = stored - further - sum(put_in.values())
    lacks = needed(window, put_in) & {*window.record.not_recorded}
    blocks = {} if lacks else by_block(window, works, time, stored - further, put_in)
    hands = further + sum(put_in.values())
    single = _works(window, works, device, time)
    return UserPort(time, hands, generated, blocks, single, _hand_work(window, works))


def pushed_by_others(results: Results) -> list[str]:
    """The connections to handles from other sources than the hands of their users."""
    return [
        name
        for name in results.record.connections
        for user in ("", *further_users(results))
        if name.endswith(f" -> {signal_of_user(HANDLE_POSE, user).partition('.')[0]}.F_hand")
        and not name.startswith(f"{signal_of_user(HAND_WRENCH, user)} ")
    ]


def _works(results: Results, works: Works, device: Table, time: Vector) -> dict[str, float]:
    """The works (J) of single wrenches on the handles at the last of the times of a window, those
    of further users named by their points, and of contacts on the mechanism."""
    signals = {
        "hand": HAND_WRENCH,
        "motors": MOTOR_WRENCH,
        "F_T": TOPOLOGY_WRENCH,
        "F_env": ENVIRONMENT_WRENCH,
    }
    found = {
        f"{user}: {name}" if user else name: _last(works.of(results, signal_name, handle, time)[0])
        for user in ("", *further_users(results))
        for name, signal in signals.items()
        if of_block(results, signal_name := signal_of_user(signal, user), 3)
        and of_block(results, handle := signal_of_user(HANDLE_POSE, user), 3)
    }
    if contact := of_block(results, ENVIRONMENT_WRENCH, 3):
        found["F_env on the mechanism"] = _last(works.ideal(results, contact, time))
    if (added := _held_mobility(results, device)) is not None:
        found["held mobility"] = _last(works.added(results, added, device, time))
    return found


def _last(work: Vector) -> float:
    return float(work[-1]) if len(work) else 0.0


def _held_mobility(results: Results, device: Table) -> Vector | None:
    """What holding the mobility adds to the motors' wrench, (n, 3) at the device's samples; None
    where it is not held, or not by zoh, or the mechanism's own is not put out."""
    held, own = (of_block(results, signal, 3, 3) for signal in MOBILITIES)
    crossing = f"{MOBILITIES[0]} -> {CONTROLLER}.Lambda_inv"
    if not held or own is not device or results.record.holds.get(crossing) != "zoh":
        return None
    rows = np.searchsorted(held["time"], device["time"] + 1e-12, "right") - 1
    change = held[MOBILITIES[0]][rows] - device[MOBILITIES[1]]
    wrench = device[HAND_WRENCH]
    for signal in (DRIFT_WRENCH, ENVIRONMENT_WRENCH):
        wrench = wrench + device[signal] if signal in device else wrench
    added: Vector = np.einsum("kij,kjl,kl->ki", device[HANDLE_INERTIA], change, wrench)
    return added
