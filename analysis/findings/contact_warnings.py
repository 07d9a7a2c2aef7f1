"""Warnings of contacts that are deeper than their geometry means, not seen while others are held,
too stiff for the steps, or not rendered."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np

from hapticlink.analysis.findings.tracking import of_block
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.depth import depths, middle, overlaps
from hapticlink.components.contact.stiffness import STABLE, poles, sticking_poles
from hapticlink.components.integrators import METHODS
from hapticlink.components.integrators.base import ContactState, Integrator
from hapticlink.components.specs.contacts import Contacts, Pair
from hapticlink.components.specs.linkage import Linkage, Mechanism
from hapticlink.orchestrator.base.signal_names import (
    CONTACT_GAP,
    CONTROLLER,
    ENVIRONMENT_WRENCH,
    JOINT_COORDINATES,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results, Table, Vector
from hapticlink.orchestrator.results.recorded_scene import scene_part

ROWS = 500
"""Largest number of rows whose depths are computed."""
UNSEEN = 1e-3
"""The depth (m) from which on a contact that no held one sees is told."""
PRESSED = 1e-4
"""The depth (m) from which on a contact at the start is no rest on an obstacle."""


def warn_of_contacts(results: Results) -> Iterator[str]:
    """A line for the deepest contact beyond the middle of a shape, and for the stiffest
    pair that pushes or sticks."""
    record, scene = results.record, results.record.scene
    table = of_block(results, CONTACT_GAP)
    if table is None or not len(table["time"]) or not scene["linkage"] or not scene["contacts"]:
        return
    yield from _warn_of_unrendered(results, table)
    linkage = scene_part(results, "linkage", Linkage)
    contacts = scene_part(results, "contacts", Contacts)
    mechanism = scene_part(results, "mechanism", Mechanism)
    if JOINT_COORDINATES in table:  # both are recorded
        if not results.record.resumed:
            yield from warn_of_pressed_start(linkage, contacts, table[JOINT_COORDINATES][0])
        yield from _deep(table, linkage, contacts)
        if contacts.detection == "graphics":
            yield from _unseen(table, linkage, contacts)
    method = METHODS.get(mechanism.integrator, Integrator)  # a plugin's may not be loaded
    if method.bounded_by and len(table["time"]) > 1:
        rate = record.fmus[CONTACT_GAP.partition(".")[0]].rate
        step_s = record.clocks[rate].longest / mechanism.substeps
        yield from _stiff(linkage, contacts, step_s, method.bounded_by)


def warn_of_pressed_start(
    linkage: Linkage, contacts: Contacts, q: Sequence[float] | Vector
) -> Iterator[str]:
    """A line for the deepest contact at the joint coordinates with which a scene starts."""
    found = [(pair, float(depth[0])) for pair, depth in depths(linkage, contacts, np.array([q]))]
    pair, depth = max(found, key=lambda item: item[1], default=(None, 0.0))
    if pair and depth > PRESSED:
        yield (
            f"warning: the scene starts inside a contact, {pair.body} {short(1e3 * depth)} mm deep "
            f"in {pair.obstacle}, which throws it out: move the obstacle, or linkage.start"
        )


def _warn_of_unrendered(results: Results, table: Table) -> Iterator[str]:
    """A line where contacts act on the mechanism and its own controller does not pass them on."""
    record = results.record
    sent = any(name.startswith(f"{ENVIRONMENT_WRENCH} -> ") for name in record.connections)
    if sent or not record.scene["controller"] or CONTROLLER in record.replaced:
        return
    closed = table["time"][table[CONTACT_GAP] < 0]
    if not len(closed):
        return
    yield (
        f"warning: contacts act on the mechanism from {closed[0]:.4g} s on and are not rendered to "
        "the hand: the handle is led to where the mechanism cannot follow; take "
        "controller.contact = true"
    )


def _deep(table: Table, linkage: Linkage, contacts: Contacts) -> Iterator[str]:
    most = {pair: middle(linkage, contacts, pair) for pair in near(linkage, contacts)}
    deep = np.flatnonzero(table[CONTACT_GAP] < -min(most.values()))
    rows = deep[np.linspace(0, len(deep) - 1, min(len(deep), ROWS)).astype(int)]
    found = [
        (*item, block["time"])
        for block in table.blocks()
        for item in overlaps(linkage, contacts, block[JOINT_COORDINATES])
    ]
    if len(rows):
        q, times = table[JOINT_COORDINATES][rows], table["time"][rows]
        each = [*depths(linkage, contacts, q)]
        deepest = np.max([depth for _, depth in each], axis=0)
        for pair, depth in each:  # one that went through is pushed back from the other side
            through = (deepest < 0) & (depth == deepest)
            found.append((pair, np.where(through, -table[CONTACT_GAP][rows], depth), times))
    if not found:
        return
    pair, depth, times = max(found, key=lambda item: _beyond(item, most))
    if (worst := float(depth.max())) > most[pair]:
        yield (
            f"warning: at {times[depth.argmax()]:.4g} s {pair.body} is {short(worst * 1e3)} mm "
            f"deep in {pair.obstacle}, past the middle of the thinner one "
            f"({short(most[pair] * 1e3)} mm): rigid bodies are not so deep in each other; take a "
            "larger contacts.stiffness, or a start at which they are apart"
        )


def _unseen(table: Table, linkage: Linkage, contacts: Contacts) -> Iterator[str]:
    """A line for the deepest contact in rows where none of those that are held touches."""
    worst, told = UNSEEN, None
    for block in table.blocks():
        apart = block[CONTACT_GAP] >= 0
        if not apart.any():
            continue
        for pair, depth in depths(linkage, contacts, block[JOINT_COORDINATES][apart]):
            if (most := float(depth.max())) > worst:
                worst, told = most, (pair, block["time"][apart][depth.argmax()])
    if told:
        pair, time = told
        yield (
            f"warning: at {time:.4g} s {pair.body} is {short(1e3 * worst)} mm deep in "
            f"{pair.obstacle}, and no contact that is held from an earlier frame touches it there: "
            "take contacts.detection = 'haptics', a higher graphics.rate, or a larger "
            "contacts.margin"
        )


def _beyond(item: tuple[Pair, Vector, Vector], most: Mapping[Pair, float]) -> float:
    pair, depth, _ = item
    return float(depth.max()) - most[pair]


def _stiff(
    linkage: Linkage, contacts: Contacts, step_s: float, bounded_by: Collection[ContactState]
) -> Iterator[str]:
    pushing = poles(linkage, contacts) if "pushing" in bounded_by else ()
    sticking = sticking_poles(linkage, contacts, step_s) if "sticking" in bounded_by else ()
    states: tuple[tuple[ContactState, Iterable[tuple[Pair, float]], str, str], ...] = (
        ("pushing", pushing, "", "damping or stiffness"),
        ("sticking", sticking, " that stick", "stiffness"),
    )
    for state, pair_poles, which, less in states:
        pair, pole = max(pair_poles, key=lambda item: item[1], default=(None, 0.0))
        if pair and pole * step_s > STABLE:
            method = next(n for n, each in METHODS.items() if state not in each.bounded_by)
            yield (
                f"warning: contacts of {pair.body} with {pair.obstacle}{which} have a pole at "
                f"{pole:.3g} 1/s, too fast for steps of {step_s:.3g} s: take a smaller "
                f"contacts.{less}, steps below {STABLE / pole:.2g} s (mechanism.substeps), or "
                f"mechanism.integrator = {method!r}"
            )
