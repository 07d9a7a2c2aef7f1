"""Warnings of contacts that are deeper than their geometry means, or too stiff for the steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic import TypeAdapter

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.depth import depths, middle
from hapticlink.components.contact.stiffness import STABLE, poles
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage, Mechanism
from hapticlink.orchestrator.results.figure_axes import short
from hapticlink.orchestrator.results.tables import Results, Table
from hapticlink.orchestrator.results.tracking import of_block

GAP, COORDINATES = "virtual_mechanism.contact_gap", "virtual_mechanism.q"
ROWS = 500
"""Largest number of rows whose depths are computed."""


def lines(results: Results) -> Iterator[str]:
    """A line for the deepest contact beyond the middle of a shape, and for the stiffest pair."""
    scene = results.run["scene"]
    table = of_block(results, GAP)
    if table is None or not len(table["time"]) or not scene["linkage"] or not scene["contacts"]:
        return
    linkage = TypeAdapter(Linkage).validate_python(scene["linkage"])
    contacts = TypeAdapter(Contacts).validate_python(scene["contacts"])
    if COORDINATES in table:  # both are recorded
        yield from _deep(linkage, contacts, table)
    mechanism = TypeAdapter(Mechanism).validate_python(scene["mechanism"])
    implicit = mechanism.integrator in ("linearly-implicit", "passive-midpoint")
    if not implicit and len(table["time"]) > 1:
        rate = results.run["fmus"][GAP.partition(".")[0]]["rate"]
        step_s = results.run["clocks"][rate]["longest"] / mechanism.substeps
        yield from _stiff(linkage, contacts, step_s)


def _deep(linkage: Linkage, contacts: Contacts, table: Table) -> Iterator[str]:
    most = {pair: middle(linkage, contacts, pair) for pair in near(linkage, contacts)}
    deep = np.flatnonzero(table[GAP] < -min(most.values()))
    if not len(deep):
        return
    chosen = deep[np.linspace(0, len(deep) - 1, min(len(deep), ROWS)).astype(int)]
    found = list(depths(linkage, contacts, table[COORDINATES][chosen]))
    pair, depth = max(found, key=lambda item: float((item[1] - most[item[0]]).max()))
    if (worst := float(depth.max())) > most[pair]:
        time = table["time"][chosen[depth.argmax()]]
        yield (
            f"warning: at {time:.4g} s {pair.body} is {short(worst * 1e3)} mm deep in "
            f"{pair.obstacle}, past the middle of the thinner one ({short(most[pair] * 1e3)} mm), "
            "where its side changes and energy with it: take a larger contacts.stiffness"
        )


def _stiff(linkage: Linkage, contacts: Contacts, step_s: float) -> Iterator[str]:
    pair, pole = max(poles(linkage, contacts), key=lambda item: item[1])
    if pole * step_s > STABLE:
        yield (
            f"warning: contacts of {pair.body} with {pair.obstacle} have a pole at {pole:.3g} 1/s, "
            f"too fast for steps of {step_s:.3g} s: take a smaller contacts.damping or stiffness, "
            f"steps below {STABLE / pole:.2g} s (mechanism.substeps), or mechanism.integrator = "
            "'linearly-implicit'"
        )
