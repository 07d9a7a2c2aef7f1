"""Spans of time that drawings mark."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticlink as hl
from hapticlink.analysis.findings.episodes import Episode, episodes, spans


@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_spans_hold_the_samples_that_have_it_and_no_others(holds: list[bool]) -> None:
    times = np.arange(len(holds), dtype=float)
    found = spans(times, np.array(holds))
    last = times[-1]
    inside = [any(a <= t < b or t == a or (t == b == last) for a, b in found) for t in times]
    assert inside[:-1] == holds[:-1]
    assert not holds[-1] or inside[-1]


def of(kind: str, found: list[Episode]) -> list[Episode]:
    return [e for e in found if e.kind == kind]


def test_a_copy_that_folds_is_marked_in_as_many_frames_as_its_output_says() -> None:
    r = hl.run("closed-loop-ideal", {"graphics.sync": "operational", "graphics.substeps": 1})
    off = r["virtual_environment.branch_ok"] == 0
    time = r.time("virtual_environment.branch_ok")
    marked = np.zeros(len(time), bool)
    for e in of("folded", episodes(r)):
        marked |= (time >= e.begin) & ((time < e.end) | (e.end == time[-1]))
    assert off.sum() > 20
    assert (marked == off).all()


@pytest.mark.parametrize(("limit", "there"), [(0.02, True), (5.0, False)])
def test_motors_that_are_too_weak_are_marked(limit: float, there: bool) -> None:
    r = hl.run(
        "closed-loop-ideal", {"device.motor.torque_limit": limit, "duration": 1.0, "stop_when": ""}
    )
    assert bool(of("saturated", episodes(r))) == there


def test_contacts_and_the_number_of_constrained_directions() -> None:
    r = hl.run("enclosure")
    found = episodes(r)
    touching = np.abs(r["virtual_mechanism.F_env"]).max(axis=1) > 0
    time = r.time("virtual_mechanism.F_env")
    within = sum(e.end - e.begin for e in of("contacts", found))
    assert within == pytest.approx(touching.sum() * (time[1] - time[0]), abs=0.01)
    count = r["virtual_environment.n_constraints"]
    (first, *_) = of("constraints", found)
    at = np.searchsorted(r.time("virtual_environment.n_constraints"), first.begin)
    assert count[at] != np.bincount(count.astype(int)).argmax()
    assert str(int(count[at])) in first.said


def test_the_force_of_another_hand_is_no_contact() -> None:
    r = hl.run("two-users", {"duration": 0.2})
    assert (r["virtual_mechanism.F_env"] != 0).any()
    assert of("contacts", episodes(r)) == []
    assert "contact" not in r.figures()
