"""The study of observers: its measures against closed forms, and the observer that was tried, with
gains by SciPy, against that of the package."""

from __future__ import annotations

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.blocks import BLOCKS
from studies.observer import cases, measure, page, tried_observer


def test_vibration_is_the_root_mean_square_of_what_is_fast() -> None:
    t = np.arange(1537) / 512
    slow, fast = 1e-3 * np.sin(2 * np.pi * 3 * t), 2e-6 * np.sin(2 * np.pi * 100 * t)
    path = np.column_stack([slow + fast, slow])
    assert measure.vibration(path, 512.0) == pytest.approx(2 / np.sqrt(2), rel=0.01)


def test_ratios_are_taken_draw_by_draw() -> None:
    def row(seed: str, observer: str, error: float) -> dict[str, object]:
        place = {"part": "kept apart", "case": "c", "seed": seed, "rate": "20", "gains": "soft"}
        return {**place, "observer": observer, measure.ERROR: error}

    rows = [row("1", cases.PRESENT, 4.0), row("1", cases.KALMAN, 1.0)]
    rows += [row("2", cases.PRESENT, 3.0), row("2", cases.KALMAN, 6.0), row("3", cases.KALMAN, 1.0)]
    assert page.ratios(rows, cases.KALMAN) == [4.0, 0.5]


def test_draws_kept_apart_are_none_that_was_tuned_on() -> None:
    tuned, apart = ({d.case.seed for d in of()} for of in (cases.tuned, cases.kept_apart))
    assert tuned.isdisjoint(apart | {d.case.seed for d in cases.on_devices()})
    assert (len(tuned), len(apart), len(list(cases.kept_apart()))) == (24, 32, 288)


def test_the_observer_with_scipy_s_gains_sees_what_that_of_the_package_sees(monkeypatch) -> None:
    monkeypatch.setitem(BLOCKS, tried_observer.NAME, tried_observer.tried_observer)
    given = {"controller.bias": "full", "duration": 0.3}
    own = {"device.observer": {"law": "kalman", "omega_n": 119.0, "beside": True}}
    ours = hl.run("closed-loop", given | own, figures=False)
    theirs = hl.run("closed-loop", given | tried_observer.options(119.0), figures=False)
    for signal, scale in (("x", 0.01), ("v", 0.1), ("F_hand_observed", 0.5)):
        a, b = ours[f"observer.{signal}"], theirs[f"observer.{signal}"]
        np.testing.assert_allclose(a, b, atol=1e-6 * scale)
