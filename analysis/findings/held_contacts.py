"""What contacts that are held between two frames of the graphics do to the mechanism: at each new
frame their geometry jumps, and with it their energy and F_env."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.tracking import of_any_shape, of_block
from hapticlink.components.contact.contact_forces import places
from hapticlink.components.contact.detection import COLUMNS
from hapticlink.components.contact.frame_changes import frame_change
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.signal_names import (
    CONTACT_GAP,
    CONTACT_GEOMETRY,
    JOINT_COORDINATES,
    JOINT_RATES,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import scene_part
from hapticlink.orchestrator.results.run_record import HeldContacts

SHARE = 0.1
"""Of what the deepest contact had stored by then, which new frames may give."""
NOTICEABLE_J = 1e-4
"""Energy (J) of 0.1 kg at 45 mm/s."""
AT_A_TICK = 1e-9  # s


def held_contacts(results: Results) -> HeldContacts | None:
    """Over all frames; None without held contacts, and where not all that they act with is known:
    recorded in every row, without delay, with the stiffness of the scene."""
    record = results.record
    scene = record.scene
    if not scene["contacts"] or scene["contacts"]["detection"] != "graphics":
        return None
    linkage = scene_part(results, "linkage", Linkage)
    contacts = scene_part(results, "contacts", Contacts)
    frames = of_block(results, CONTACT_GEOMETRY, places(linkage, contacts), len(COLUMNS))
    steps = of_any_shape(results, JOINT_COORDINATES)
    late = any(name.startswith(f"{CONTACT_GEOMETRY} -> ") for name in record.latencies)
    changed = any("contact" in text for _, text in record.events)
    if frames is None or steps is None or late or changed or scene["record"]["every"] > 1:
        return None
    if not {JOINT_RATES, CONTACT_GAP} <= steps.keys() or len(frames["time"]) < 2:
        return None
    times = frames["time"][1:]
    ticks = np.searchsorted(steps["time"], times - AT_A_TICK)
    ticks = ticks[ticks < len(steps["time"]) - 1]  # the last row has no step after it
    rows = frames[CONTACT_GEOMETRY].reshape(len(frames["time"]), -1)
    count = len(ticks)
    if not count:
        return None
    change = frame_change(linkage, contacts, scene["directions"]["length_scale"])
    states = steps[JOINT_COORDINATES][ticks].T, steps[JOINT_RATES][ticks].T
    energy, wrench = change(*states, rows[:count].T, rows[1 : count + 1].T)
    gains, jumps = np.array(energy).ravel(), np.linalg.norm(np.array(wrench)[:2], axis=0)
    deepest = np.maximum.accumulate(np.maximum(0.0, -steps[CONTACT_GAP]))[ticks[:count]]
    stored = 0.5 * contacts.stiffness * deepest**2
    worst, jumped = int((gains - SHARE * stored).argmax()), int(jumps.argmax())
    return HeldContacts(
        given=float(gains[gains > 0].sum()),
        taken=-float(gains[gains < 0].sum()),
        largest_gain=max(0.0, float(gains[worst])),
        time_of_gain=float(times[worst]),
        stored=float(stored[worst]),
        largest_jump=float(jumps[jumped]),
        time_of_jump=float(times[jumped]),
    )


def why_unchecked(results: Results) -> Iterator[str]:
    """A line where contacts are held, and `held_contacts` does not know all that they act with."""
    held = results.record.scene["contacts"]["detection"] == "graphics"
    if held and len(results.haptics["time"]):
        yield (
            "what new frames of contacts gave the mechanism is not checked: that needs two frames, "
            "and contacts, q, qd and contact_gap in every row, without latency or change"
        )


def describe_held(held: HeldContacts) -> Iterator[str]:
    """A line of what new frames did, if they did anything."""
    if held.largest_jump > 0.0:
        yield (
            f"contacts held between frames: at a new frame F_env jumps by at most "
            f"{short(held.largest_jump)} N, at {held.time_of_jump:.4g} s; frames gave "
            f"{short(1e3 * held.given)} mJ and took {short(1e3 * held.taken)} mJ"
        )


def warn_of_held(held: HeldContacts) -> Iterator[str]:
    """A line if a frame gave more than a share of what the deepest contact stored."""
    if held.largest_gain > max(SHARE * held.stored, NOTICEABLE_J):
        yield (
            f"warning: the new frame of contacts at {held.time_of_gain:.4g} s gave the mechanism "
            f"{short(1e3 * held.largest_gain)} mJ, where the deepest contact had stored "
            f"{short(1e3 * held.stored)} mJ by then: what it touches was met late, or the geometry "
            "turned while it was held; take contacts.detection = 'haptics', or a higher "
            "graphics.rate"
        )
