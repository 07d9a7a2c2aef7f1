"""Small systems of real FMUs for tests of couplings, with answers known in closed form."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build_fmu import build
from hapticlink.orchestrator.base.ticks import Clock, Timeline
from hapticlink.orchestrator.fmi.description import Description, describe
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.read_results import Table
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.execute_plan import Outcome, run
from hapticlink.orchestrator.scene.scene_tables import Iteration, PowerPort, SetSpring
from hapticlink.orchestrator.system.system import Coupling, EnergyPorts, Fmu, System
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.native_mass import POWER, ROWS, SPRINGS, exact, matrix
from tests.orchestrator.systems import BARE, connected

HERMITE = [*ROWS, ("one.a", "two.a1")]
"""der(F) of `two` needs the acceleration of `one`."""


def stiff_exact(
    times: NDArray[np.float64], k_1: float, k_2: float, k_c: float, c_c: float
) -> NDArray[np.float64]:
    """Rows x1, x2, of both masses at rest at 1 m in the beginning."""
    a, start = matrix(k_1, k_2, 0.0, k_c, c_c), np.array([1.0, 0.0, 1.0, 0.0])
    return np.array([(expm(a * t) @ start)[[0, 2]] for t in times])


def gain(name: str, factor: float, offset: float, timing: str = "continuous") -> Component:
    """y = factor u + offset, through and through; z is the u of the step before."""
    block = Block(
        inputs=[Variable("u"), Variable("w")],
        states=[Variable("z")],
        outputs=[Variable("y"), Variable("z")],
    )
    u, w, z = block.u["u"], block.u["w"], block.x["z"]
    output = {"y": factor * u + offset, "z": z}
    initial = {"z": ca.SX(0.0)}
    return block.component(
        name, "feed-through", timing, initial=initial, step={"z": w}, output=output
    )


def described(components: Iterable[Component], folder: Path) -> dict[str, Description]:
    return {c.name: describe(build(c, folder)) for c in components}


def system(
    fmus: Mapping[str, Description],
    rows: Iterable[tuple[str, str]],
    coupling: str,
    period: Fraction,
    until: Fraction,
    *,
    base: Fraction | None = None,
    between: str | None = None,
    hold: str | Mapping[str, str] | None = None,
    substeps: int = 1,
    power: tuple[PowerPort, ...] = (),
    springs: tuple[SetSpring, ...] = (),
    **others: object,
) -> System:
    """All FMUs at one rate. between: the hold of iterated connections; hold: of all connections,
    or by source."""
    ticks = int(period / base) if base else 1
    steps = int(until / period)
    clock = Clock("haptics", range(0, (steps + 3) * ticks, ticks))
    timeline = Timeline(period / ticks, steps * ticks, (clock,))
    units = tuple(Fmu(name, fmu, "haptics") for name, fmu in fmus.items())
    rows = list(rows)
    holds = dict.fromkeys(dict(rows), hold) if isinstance(hold, str) else hold or {}
    iteration = Iteration(interpolation=between or "foh")
    scheme = "iterated" if between else "gauss-seidel"
    bare = replace(BARE, holds=holds, coupling=scheme, iteration=iteration)
    energy = EnergyPorts(power, springs)
    connections, _ = connected(units, rows, timeline, bare, energy)
    how = Coupling(coupling, substeps=dict.fromkeys(fmus, substeps), **others)
    return System(units, connections, timeline, how, energy=energy)


def masses(
    fmus: Mapping[str, Description],
    period: Fraction,
    steps: int,
    hold: str | Mapping[str, str],
    coupling: str = "jacobi",
    get_after_set: tuple[str, ...] = ("two",),
    substeps: int = 1,
) -> System:
    """The two-mass native_mass."""
    energy = {"power": POWER, "springs": SPRINGS}
    how = {"hold": hold, "substeps": substeps, "get_after_set": get_after_set}
    return system(fmus, ROWS, coupling, period, steps * period, **how, **energy)


NEWTON = Iteration(method="newton", tolerance=1e-10)


def iterated(
    fmus: Mapping[str, Description],
    until: Fraction,
    between: str,
    *,
    rate: int = 100,
    rows: Iterable[tuple[str, str]] = ROWS,
    iteration: Iteration = NEWTON,
    **others: object,
) -> System:
    """Both masses, whose steps are repeated until the values between them agree."""
    return system(
        fmus, rows, "iterated", Fraction(1, rate), until, between=between, iteration=iteration,
        get_after_set=("one", "two"), **others,
    )  # fmt: skip


def order(rates: Sequence[int], errors: Sequence[float]) -> float:
    """The observed order of accuracy."""
    return -float(np.polyfit(np.log(rates), np.log(errors), 1)[0])


def simulate(made: System) -> tuple[Outcome, Table]:
    results = RunResults()
    return run(Plan(made), results), results.tables()["haptics"]


def rows(made: System) -> Table:
    """Of a run without a fault."""
    outcome, table = simulate(made)
    assert outcome.fault is None
    return table


def motion(table: Table) -> NDArray[np.float64]:
    """Rows x1, v1, x2, v2 of the two-mass native_mass."""
    return np.stack([table[name] for name in ("one.x", "one.v", "two.x", "two.v")], axis=1)


def error(table: Table) -> float:
    """The largest error of a position of the two-mass native_mass."""
    return float(np.abs(motion(table) - exact(table["time"]))[:, [0, 2]].max())


def scene_of(
    fmus: Mapping[str, Description], settings: str, one: str = "", force: str = ""
) -> Path:
    """A scene file of both masses beside their FMUs, with further lines of its own, of the table of
    `one` and of the connection of the force."""
    text = settings + fmu_table("one", "one", one) + fmu_table("two", "two")
    text += wire_table("two.F", "one.F", force)
    text += wire_table("one.x", "two.x1") + wire_table("one.v", "two.v1")
    return scene(fmus["one"].path.parent, text, 100)
