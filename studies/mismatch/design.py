"""The runs of the study: every method on the same cases, in two arrangements of the rates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib.util import find_spec
from itertools import product

from hapticlink.analysis.sweep.job import Job, job
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.scene import Scene
from studies.mismatch.cases import Case, at_rest
from studies.mismatch.methods import (
    BIAS,
    COLUMNS,
    COMPARED,
    FEW,
    GAINS,
    INTEGRATORS,
    KEPT_APART,
    LIKELY,
    OF_MATRICES,
    OF_MOTION,
    RATES,
    REPORT,
    VARIABLE,
    Method,
    rate_option,
)

DIRECT, MOBILITY, CONTINUOUS = "direct", "mobility", "continuous"
"""direct: the mechanism at the graphics rate; mobility: at 512 Hz, with Lambda^-1 and P_c held;
continuous: everything at REFERENCE, nothing held."""
REFERENCE, FLOOR = 8192, 4096
"""Rates (Hz) of the runs taken as continuous, and of those that estimate their error."""
ADAPTIVE = ("passive", "pspm")
SUBSTEPS = 16
"""Integration steps a frame of a mechanism that touches walls."""


def arranged(arrangement: str, case: Case) -> tuple[str, ...]:
    """The options of an arrangement."""
    packed = (f"packaging={'native' if find_spec('ziglang') else 'python'}",)
    touching = ("contacts.detection=haptics",) if case.contact else ()
    if arrangement == MOBILITY:
        return packed
    if arrangement == CONTINUOUS:
        return (*packed, "directions_from=mechanism", *touching)
    steps = (f"mechanism.substeps={SUBSTEPS}",) if case.contact else ()
    own = ("mechanism_at=graphics", "directions_from=mechanism")
    return (*packed, *own, *touching, *steps)


@cache
def run(arrangement: str, case: Case, method: Method, bias: str, rate: str) -> Job:
    """One run; `rate` is that of the graphics, in a continuous run that of everything."""
    options = [*case.options, *arranged(arrangement, case), *method.options]
    options.append(f"controller.bias={bias}")
    if arrangement == CONTINUOUS:
        options.append(f"haptics.rate={rate}")
    else:
        options.append(rate_option(rate, case.seed))
    return job(_read(case.scene), options, point(arrangement, case, method, bias, rate))


@cache
def _read(scene: str) -> Scene:
    """A scene whose files are read once."""
    return open_scene.load(scene)


def point(arrangement: str, case: Case, method: Method, bias: str, rate: str) -> dict[str, str]:
    """The key columns of a run."""
    of_case = {"case": case.name, "linkage": case.linkage, "hand": case.hand}
    of_case |= {"contact": str(case.contact).lower(), "seed": str(case.seed)}
    return {"arrangement": arrangement, **of_case, **method._asdict(), "bias": bias, "rate": rate}


def references(cases: Iterable[Case]) -> Iterator[Job]:
    for case, bias, rate in product(cases, BIAS, (REFERENCE, FLOOR)):
        yield run(CONTINUOUS, case, Method("zoh", REPORT), bias, str(rate))


def methods(arrangement: str, bias: str, rate: str) -> list[Method]:
    """The methods that are compared. All are at FEW rates with the report's model, which has no
    Coriolis compensation; elsewhere neither the report's gains nor integrators, and LIKELY holds
    of a mechanism at the graphics rate."""
    whole = rate in FEW and bias == "none"
    gains = [g for g in GAINS if whole or g != REPORT]
    if arrangement == MOBILITY:
        return [Method(*each) for each in product(OF_MATRICES, gains) if each[1] != "soft"]
    found = [Method(hold, g) for hold, g in product(OF_MOTION if whole else LIKELY, gains)]
    others = [i for i in INTEGRATORS if whole and i != "rk4"]
    return found + [Method(h, "medium", i) for h, i in product(COMPARED, others)]


def cells(apart: bool) -> Iterator[tuple[str, str, str, list[Method]]]:
    """Arrangement, bias and rate with the methods that are tried there; of the cases kept apart
    those that can be advised, also at the rate kept apart."""
    columns = (*COLUMNS, KEPT_APART) if apart else COLUMNS
    for arrangement, bias, rate in product((DIRECT, MOBILITY), BIAS, columns):
        every = methods(arrangement, bias, rate)
        yield arrangement, bias, rate, [m for m in every if m.candidate or not apart]


def runs(cases: Sequence[Case], *, apart: bool = False) -> list[Job]:
    """All runs by which methods are chosen, the references first; of cases kept apart those by
    which advice is compared with the best of all methods."""
    found = [*references(cases)]
    for arrangement, bias, rate, tried in cells(apart):
        for method, case in product(tried, cases):
            found.append(run(arrangement, case, method, bias, rate))
    return found


def count(cases: int, *, apart: bool = False) -> int:
    """How many runs `runs` has on so many cases."""
    return cases * (sum(len(tried) for *_, tried in cells(apart)) + 2 * len(BIAS))


def margins(linkages: Iterable[str], wanted: Iterable[tuple[str, Method, str]]) -> list[Job]:
    """The scenes at rest of each (arrangement, method, rate), whose lifted maps give the margins.
    At rest the compensation of Coriolis terms has no slope, so that one is taken for both models;
    periods that vary have no map of one frame."""
    found = []
    for linkage, (arrangement, method, rate) in product(linkages, wanted):
        if rate != VARIABLE:
            found.append(run(arrangement, at_rest(linkage), method, "none", rate))
    return found


def mapped(method: Method) -> bool:
    """Whether a lifted map vouches for a method: the laws of adaptive holds have no slope at
    rest."""
    return not any(name in method.hold for name in ADAPTIVE)


def all_margins() -> list[tuple[str, Method, str]]:
    """Every method with rk4 that a map vouches for, at the fixed rates at which it is tried."""
    every = (
        (arrangement, of_map(arrangement, method), rate)
        for arrangement, rate in product((DIRECT, MOBILITY), RATES)
        for method in methods(arrangement, "none", rate)
        if mapped(method) and method.integrator == "rk4"
    )
    return list(dict.fromkeys(every))


def of_map(arrangement: str, method: Method) -> Method:
    """The method whose lifted map is that of `method`: of held mobilities `zoh`, since at rest
    there is no force that they turn into motion, and no hold of them has a slope."""
    return method._replace(hold="zoh") if arrangement == MOBILITY else method
