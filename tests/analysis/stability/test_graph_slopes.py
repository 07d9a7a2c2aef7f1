"""Slopes from the graphs of FMUs, against differences of the FMUs and against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.analysis.stability import forward_sensitivity
from hapticlink.analysis.stability.graph_slopes import GraphSlopes
from tests.analysis.stability.own_hand import own_hand
from tests.analysis.stability.test_stability import HELD

Matrix = NDArray[np.float64]
AMPLIFIED = 1000
"""Of the rounding of results of order 1, by mobilities of 400 1/kg on the way to them."""
CASES = {
    "rail": ("sampled-spring", {}, {}),
    "wall": ("virtual-wall", {}, {}),
    "substeps": ("virtual-wall", {"mechanism.substeps": 3}, {}),
    "pendulum": ("pendulum", {}, {}),
    "native": ("pendulum", {"packaging": "native"}, {}),
    "native substeps": ("virtual-wall", {"packaging": "native", "mechanism.substeps": 3}, {}),
    "neutral modes": ("scotch-yoke", {}, {"virtual_mechanism": {"closure_error"}}),
    "encoders": (
        "closed-loop-direct",
        {**HELD, "graphics.rate": 128, "sensing": "encoders"},
        {"virtual_mechanism": {"closure_error"}},
    ),
    "graphics copy": (
        "closed-loop",
        {**HELD, "graphics.rate": 128},
        {"virtual_mechanism": {"closure_error"}, "virtual_environment": {"q_error"}},
    ),
}
"""Scene, options, and by FMU what may have no slope at rest: norms of errors that are 0."""


@pytest.mark.parametrize("case", CASES)
def test_the_graph_has_the_slopes_of_the_fmu(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Central differences by d leave d^2 |f'''|/6 and the rounding eps |f|/d; that to both sides
    differ by d |f''| bounds the first."""
    scene, options, without = CASES[case]
    compared, worst = 0, 0.0
    decide = forward_sensitivity.decided

    def watched(exact: Matrix, slope: Matrix, error: Matrix) -> Any:
        nonlocal compared, worst
        rounding = AMPLIFIED * np.finfo(float).eps / forward_sensitivity.STEP
        allowed = np.abs(error) + rounding * np.maximum(1.0, np.abs(slope).max(axis=0, initial=0.0))
        has = np.isfinite(exact)
        compared += int(np.count_nonzero(exact[has]))
        worst = max(worst, (np.abs(slope - exact) / allowed)[has].max(initial=0.0))
        return decide(exact, slope, error)

    def elsewhere(own: Matrix, J: Matrix) -> tuple[Matrix, Matrix]:
        return own + 1.0, J

    found = own_hand(scene, options)
    monkeypatch.setattr(forward_sensitivity, "decided", watched)
    for name in ("step", "get"):  # a graph with another result leaves the differences to the FMU
        call = getattr(GraphSlopes, name)
        monkeypatch.setattr(GraphSlopes, name, lambda *given, call=call: elsewhere(*call(*given)))
    one_by_one = own_hand(scene, options)
    assert compared > 10
    assert one_by_one.slopes == found.slopes
    assert one_by_one.radius == pytest.approx(found.radius, abs=1e-9)
    assert worst < 1.0
    for fmu, way in found.slopes.items():
        graph, _, others = way.partition("; by differences: ")
        assert graph == "graph"
        assert set(filter(None, others.split(", "))) <= without.get(fmu, set())

    monkeypatch.setattr(forward_sensitivity, "graph_slopes", lambda *_: None)
    differences = own_hand(scene, options)
    assert set(differences.slopes.values()) == {"differences"}
    both = found.first.uncertainty + differences.first.uncertainty
    assert abs(found.radius - differences.radius) <= both
    assert found.verdict == differences.verdict


def test_semi_implicit_euler_of_a_pendulum_has_the_eigenvalues_of_its_map() -> None:
    """Of a hanging rod, phi'' = -w^2 phi - c phi': z^2 - (2 - (w h)^2 - c h) z + 1 - c h = 0."""
    h, c = 1 / 512, 0.01 * 3
    found = own_hand("pendulum", {"mechanism.integrator": "semi-implicit-euler"})
    z = np.roots([1.0, -(2 - 1.5 * 9.81 * h**2 - c * h), 1 - c * h])[0]
    (mode,) = found.modes
    assert mode.z.real == pytest.approx(z.real, abs=1e-14)
    assert abs(mode.z.imag) == pytest.approx(abs(z.imag), abs=1e-13)
    assert found.radius == pytest.approx(math.sqrt(1 - c * h), abs=1e-14)
