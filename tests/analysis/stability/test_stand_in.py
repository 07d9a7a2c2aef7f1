"""FMUs whose state cannot be read, in the analysis of stability: what their response tells, against
closed forms, and what it does not tell."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.frozen_nonlinearities import describe_switches
from hapticlink.analysis.stability.identified_response import NotIdentified, identify
from hapticlink.analysis.stability.smooth_scene import linearisable
from tests.analysis.stability.own_hand import own_hand
from tests.little_fmus import entries, slave
from tests.orchestrator.c_fmus import equations_fmu

T = 0.05
K, B = 100.0, 2.0
Law = Callable[[float, float, dict[Any, float]], float]
"""The output of a step from the input, the time and a memory."""


def lead_lag(e: float, _: float, own: dict[Any, float]) -> float:
    y = 0.8 * own.get("y", 0.0) + K * (e - 0.7 * own.get("e", 0.0))
    own.update(y=y, e=e)
    return y


def delayed(e: float, t: float, own: dict[Any, float]) -> float:
    own[round(t / T)] = K * e
    return own.get(round(t / T) - 5, 0.0)


def integral(e: float, _: float, own: dict[Any, float]) -> float:
    own["y"] = own.get("y", 0.0) + T * e
    return K * e + own["y"]


def responding(law: Law) -> Callable[[np.ndarray], np.ndarray]:
    """Of two inputs and outputs: the law of their difference, and half the second input."""

    def respond(given: np.ndarray) -> np.ndarray:
        own: dict[Any, float] = {}
        return np.array([(law(a - b, k * T, own), b / 2) for k, (a, b) in enumerate(given)])

    return respond


@pytest.mark.parametrize(
    ("law", "order"),
    [
        (lambda e, t, own: K * e, 0),
        (lead_lag, 1),
        (delayed, 5),
        (integral, 1),
        (lambda e, t, own: max(-5.0, min(5.0, K * e)), 0),  # saturates further away
    ],
)
def test_order_and_response_of_linear_laws(law: Law, order: int) -> None:
    found = identify(responding(law), np.array([0.01, 0.01]), ["a", "b"])
    assert found.order == order
    assert found.error < 1e-8
    own: dict[Any, float] = {}
    x = np.zeros(order)
    for k, a in enumerate(np.sin(np.arange(40.0)) * 1e-2):
        u = np.array([0.01 + a, 0.01])
        y = found.y0 + found.C @ x + found.D @ (u - found.u0)
        x = found.A @ x + found.B @ (u - found.u0)
        assert y == pytest.approx([law(a, k * T, own), 0.005], abs=1e-8)


@pytest.mark.parametrize(
    ("law", "why"),
    [
        (lambda e, t, own: np.sin(t), "1 of its outputs move with constant inputs"),
        (lambda e, t, own: K * abs(e), "is not linear: it is at a kink"),
        (lambda e, t, own: K * e**2, "is not linear: it is at a kink"),
        (lambda e, t, own: round(e / 1e-3), "a does nothing by 0.0001 .* a count or a dead zone"),
        (lambda e, t, own: own.setdefault(round(t / T), e) * own.get(round(t / T) - 99, 1.0),
         "errs by .* memory of more than 64 steps"),
        (lambda e, t, own: (1 + t) * e, "errs by .* or changes with time"),
        (lambda e, t, own: float("nan"), "its outputs are not finite"),
    ],
)  # fmt: skip
def test_what_the_response_does_not_tell_is_refused_with_the_reason(law: Law, why: str) -> None:
    with pytest.raises(NotIdentified, match=why):
        identify(responding(law), np.array([0.01, 0.01]), ["a", "b"])


@pytest.mark.parametrize(
    ("law", "early", "on_run"),
    [
        (lambda e, t, own: K * e, 0.0, 0.0),
        (lead_lag, 0.0, 0.0),
        # half as stiff for its first 100 steps
        (lambda e, t, own: (K if t > 100 * T else K / 2) * e, 0.5, 0.5),
        # limited to half of what the run asks of it
        (lambda e, t, own: max(-5.0, min(5.0, K * e)), 0.0, 1.0),
    ],
)
def test_a_law_that_changes_early_or_with_size_is_found_out(
    law: Law, early: float, on_run: float
) -> None:
    run = np.stack([0.1 * np.sin(0.1 * np.arange(200.0)), np.zeros(200)], axis=1)
    found = identify(responding(law), np.array([0.01, 0.01]), ["a", "b"], run)
    assert found.error < 1e-8
    assert (found.early, found.on_run) == pytest.approx((early, on_run), rel=0.3, abs=1e-8)


def spring(folder: Path, force: str, ports: str = "x", **options: Any) -> dict[str, Any]:
    """Options with an FMU of Python in the place of the hand, which hides its memory."""
    inputs = {name: 0.0 for port in ports for name in entries(port, 3)}
    body = f"""own = self.__dict__.setdefault("own", {{}})
        e = -values["x[1]"]
        values["F[1]"] = {force}"""
    path = slave(folder, "Law", ("input", inputs), ("output", entries("F", 3)), body=body)
    start = {"linkage.start": {"rail": 0.0}}
    return {"fmu": [{"replaces": "hand", "path": str(path), **options}], **start}


def growth(A: np.ndarray, b: np.ndarray, c: np.ndarray, d: float) -> float:
    """1/s of a mass of 1 kg on a sampled law x' = A x + b e, F = c x + d e, e = - its position."""
    plant, force = np.array([[1, T], [0, 1]]), np.array([[T * T / 2], [T]])
    place = np.array([[1.0, 0.0]])
    loop = np.block([[plant - d * force @ place, force @ c], [-b @ place, A]])
    return float(np.log(np.abs(np.linalg.eigvals(loop)).max()) / T)


@pytest.mark.parametrize(
    ("force", "system"),
    [
        ("100.0 * e", (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 100.0)),
        ("own.setdefault(round(time / size), 100.0 * e) * 0 + own.get(round(time / size) - 1, 0.0)",
         (np.zeros((1, 1)), np.ones((1, 1)), np.full((1, 1), 100.0), 0.0)),
    ],
)  # fmt: skip
def test_growth_with_a_law_of_python_is_that_of_the_closed_form(
    tmp_path: Path, force: str, system: Any
) -> None:
    found = own_hand("sampled-spring", spring(tmp_path, force))
    assert found.growth == pytest.approx(growth(*system), rel=1e-7)


def test_the_verdict_says_what_stands_for_the_fmu_and_how_exact_it_is(tmp_path: Path) -> None:
    verdict = hl.equilibrium_stability("sampled-spring", spring(tmp_path, "100.0 * e"))
    assert isinstance(verdict, hl.Stability)
    (each,) = verdict.record()["stand_ins"]
    assert (each["fmu"], each["order"]) == ("hand", 0)
    assert each["error"] < 1e-9
    assert max(each["early"], each["on_run"]) < 1e-9
    assert "hand: its state cannot be read; a linear system of order 0 stands" in str(verdict)


@pytest.mark.parametrize(
    ("force", "says"),
    [
        ("100.0 * e", ()),
        ("(100.0 if time > 1.0 else 50.0) * e", ("in its first 512 steps the FMU is another",)),
        ("max(-0.1, min(0.1, 100.0 * e))", ("over that run the FMU is not this system",)),
    ],
)
def test_the_verdict_says_where_the_fmu_is_another_system(
    tmp_path: Path, force: str, says: tuple[str, ...]
) -> None:
    """The mass starts at rest .01 m from where the spring is relaxed."""
    given = spring(tmp_path, f"{force} - 5.0 * values['v[1]']", "xv") | {"haptics.rate": 64}
    given["linkage.start"] = {"rail": 0.01}
    verdict = hl.equilibrium_stability("sampled-spring", given)
    every = ("in its first 512 steps the FMU is another", "over that run the FMU is not this")
    assert tuple(each for each in every if each in str(verdict)) == tuple(
        each for each in every if any(one.startswith(each) for one in says)
    )


def test_a_parameter_that_changes_takes_another_system(tmp_path: Path) -> None:
    """A map sets parameters where it can: not those of an FMU for which a system stands."""
    body = 'values["F[1]"] = -self.K * values["x[1]"]'
    ports = ("input", entries("x", 3)), ("output", entries("F", 3)), ("tunable", {"K": 100.0})
    path = slave(tmp_path, "Law", *ports, body=body)
    given = {"fmu": [{"replaces": "hand", "path": str(path)}], "linkage.start": {"rail": 0.0}}
    points = hl.stability_map(
        "sampled-spring", ["fmu.hand.start.K=100.0,50.0"], given, out=tmp_path / "map", jobs=1
    )
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    found = {float(row["fmu.hand.start.K"]): row["growth_rate"] for row in points.of("grid")}
    expected = {stiff: pytest.approx(growth(*none, stiff), rel=1e-6) for stiff in (100.0, 50.0)}
    assert found == expected


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_states_of_an_fmu_for_model_exchange_are_those_that_it_declares(
    tmp_path: Path, fmi: str
) -> None:
    """A mass x'' = - K z (F_drift acts with -) and z' = k (x - z), each with the other's value held
    over a step."""
    path, k = equations_fmu(tmp_path, fmi), 4.0
    lag = {"name": "lag", "path": str(path), "start": {"k": k, "level": -9.0, "x": 0.0}}
    ends = [("virtual_mechanism.x[1]", "lag.u", 1.0), ("lag.x", "virtual_mechanism.F_drift[1]", K)]
    wires = [{"from": a, "to": b, "factor": by, "convert": False} for a, b, by in ends]
    hand = {"type": "constant", "wrench": [0.0, 0.0, 0.0]}
    options = {"fmu": [lag], "connection": wires, "hand": hand, "linkage.start": {"rail": 0.0}}
    found = own_hand("sampled-spring", {**options, "coupling": "jacobi"})
    decay = np.exp(-k * T)
    A = np.array([[1, T, -K * T**2 / 2], [0, 1, -K * T], [1 - decay, 0, decay]])
    growth_ = np.log(np.abs(np.linalg.eigvals(A)).max()) / T
    assert found.growth == pytest.approx(growth_, rel=2e-5)  # differences of a solver
    with linearisable("sampled-spring", options) as (_, system, _):
        (line,) = describe_switches(system)
    assert "lag: discrete states of the FMU for model exchange, as at the equilibrium" in line


def test_one_that_is_not_sampled_is_refused(tmp_path: Path) -> None:
    with pytest.raises(hl.InputFault, match=r"hand: its FMU does not declare .* of a sampled FMU"):
        own_hand("sampled-spring", spring(tmp_path, "100.0 * e", timing="continuous"))
