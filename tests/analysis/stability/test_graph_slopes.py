"""Slopes from the graphs of FMUs, against differences of the FMUs and against closed forms."""

from __future__ import annotations

import math
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.analysis.stability import forward_sensitivity
from hapticlink.analysis.stability.forward_sensitivity import ForwardSensitivity
from hapticlink.analysis.stability.graph_slopes import GraphSlopes, graph_slopes
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.plan.operations import Get, Step
from hapticlink.orchestrator.system.build_system import build_system
from tests.analysis.stability.own_hand import own_hand
from tests.analysis.stability.test_stability import HELD

Matrix = NDArray[np.float64]
AMPLIFIED = {"observer beside": 10_000}
"""Of the rounding of results of order 1, by default 1000, by mobilities of 400 1/kg on the way to
them; more in the observed acceleration, of a force that is omega_n^2 = 2500 times a small error."""
NORM = 1
"""Output of the mechanism and of its copy that is the norm of an error, which is 0 at rest; twice
where it is read: among the FMU's numbers and among the signals."""
CASES = {
    "rail": ("sampled-spring", {}, 0),
    "wall": ("virtual-wall", {}, 0),
    "substeps": ("virtual-wall", {"mechanism.substeps": 3}, 0),
    "pendulum": ("pendulum", {}, 0),
    "native": ("pendulum", {"packaging": "native"}, 0),
    "native substeps": ("virtual-wall", {"packaging": "native", "mechanism.substeps": 3}, 0),
    "neutral modes": ("scotch-yoke", {}, NORM),
    "encoders": (
        "closed-loop-direct", {**HELD, "graphics.rate": 128, "sensing": "encoders"}, NORM
    ),
    "observer beside": (
        "closed-loop-direct",
        {**HELD, "graphics.rate": 128, "sensing": "encoders", "device.observer.beside": True},
        NORM,
    ),
    "kalman": (
        "closed-loop-direct",
        {**HELD, "graphics.rate": 128, "sensing": "encoders", "device.observer.law": "kalman"},
        NORM,
    ),
    "graphics copy": ("closed-loop-ideal", {**HELD, "graphics.rate": 128}, NORM),
}  # fmt: skip
"""Scene, options, and how many outputs of an FMU may have no slope at the equilibrium."""


@pytest.mark.parametrize("case", CASES)
def test_the_graph_has_the_slopes_of_the_fmu(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Central differences by d leave d^2 |f'''|/6 and the rounding eps |f|/d; that to both sides
    differ by d |f''| bounds the first."""
    scene, options, without = CASES[case]
    compared, worst, missing = 0, 0.0, set[bool]()
    apart, latest = dict[Any, int](), None
    decide, in_graph = forward_sensitivity.combine_slopes, ForwardSensitivity._in_graph

    def counted(exact: Matrix, slope: Matrix, error: Matrix) -> Any:
        J, E = decide(exact, slope, error)
        apart[latest] = np.count_nonzero((exact != J).any(axis=1))
        return J, E

    def asked(self: ForwardSensitivity, operation: Any, *given: Any) -> Any:
        nonlocal latest
        found, latest = in_graph(self, operation, *given), operation
        if isinstance(operation, Step | Get):
            missing.add(found is None)
        return found

    def watched(exact: Matrix, slope: Matrix, error: Matrix) -> Any:
        nonlocal compared, worst
        rounding = AMPLIFIED.get(case, 1000) * np.finfo(float).eps / forward_sensitivity.STEP
        allowed = np.abs(error) + rounding * np.maximum(1.0, np.abs(slope).max(axis=0, initial=0.0))
        has = np.isfinite(exact)
        compared += int(np.count_nonzero(exact[has]))
        worst = max(worst, (np.abs(slope - exact) / allowed)[has].max(initial=0.0))
        return counted(exact, slope, error)

    def elsewhere(own: Matrix, J: Matrix) -> tuple[Matrix, Matrix]:
        return own + 1.0, J

    monkeypatch.setattr(ForwardSensitivity, "_in_graph", asked)
    monkeypatch.setattr(forward_sensitivity, "combine_slopes", counted)
    found = own_hand(scene, options)
    by_graph = dict(apart)
    apart.clear()
    monkeypatch.setattr(forward_sensitivity, "combine_slopes", watched)
    for name in ("step", "get"):  # a graph with another result leaves the differences to the FMU
        call = getattr(GraphSlopes, name)
        monkeypatch.setattr(GraphSlopes, name, lambda *given, call=call: elsewhere(*call(*given)))
    one_by_one = own_hand(scene, options)
    assert compared > 10
    assert apart == by_graph
    assert max(apart.values()) <= 2 * without
    assert one_by_one.radius == pytest.approx(found.radius, abs=1e-9)
    assert worst < 1.0
    assert missing == {False}

    missing.clear()
    monkeypatch.setattr(forward_sensitivity, "graph_slopes", lambda *_: None)
    differences = own_hand(scene, options)
    assert missing == {True}
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


def test_threads_that_judge_at_once_have_slopes_of_their_own() -> None:
    scene = open_scene.load("pendulum")
    with build_system(scene) as system:
        fmu = system.fmu["virtual_mechanism"]
        graph = graph_slopes(fmu.description, fmu.name, scene)
    assert graph
    n, own = graph._n, np.random.default_rng(1)
    points = [
        (own.normal(size=sum(n)), own.normal(size=(2, sum(n[i] for i in (1, 3, 4)))))
        for _ in range(2)
    ]

    def slopes(point: int) -> bytes:
        return b"".join(part.tobytes() for part in graph.step(*points[point], 0.002))

    alone, often = [slopes(0), slopes(1)], sys.getswitchinterval()
    assert alone[0] != alone[1]
    try:
        sys.setswitchinterval(1e-6)
        with ThreadPoolExecutor(2) as threads:
            found = [*threads.map(lambda i: [slopes(i) for _ in range(1000)], (0, 1))]
    finally:
        sys.setswitchinterval(often)
    assert found == [[one] * 1000 for one in alone]


def test_a_native_fmu_has_the_bits_of_a_python_one() -> None:
    """Verdicts take native FMUs where the cache has them, and say the same to the byte."""
    found = []
    for packaging in ("python", "native"):
        scene = open_scene.load("pendulum", [f"packaging={packaging}"])
        with build_system(scene) as system:
            graph = graph_slopes(
                system.fmu["virtual_mechanism"].description, "virtual_mechanism", scene
            )
        assert graph
        draw = np.random.default_rng(4)
        before, own = (
            draw.normal(size=sum(graph._n)),
            draw.normal(size=(3, sum(graph._n) - 1 - graph._n[2])),
        )
        found.append([*graph.step(before, own, 1 / 512), *graph.get(before, own)])
    for python, native in zip(*found, strict=True):
        assert python.tobytes() == native.tobytes()
