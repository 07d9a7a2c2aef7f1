"""The two-mass oscillator split in two exact subsystems, so that only coupling error remains: its
solution, and compiled FMUs of the two, whose inputs are constant over a step.

m x1'' = -k x1 - c v1 + F,   m x2'' = -k x2 - c v2 - F,   F = k_c (x2 - x1) + c_c (v2 - v1)
with m = 1, k = k_c = 100, c = c_c = 1, x = (0, 1), v = (1, 0) at WARM. `one` takes F, `two` x1, v1.
Until WARM both follow the exact solution of the whole, so that every hold has its history.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hapticlink.orchestrator.fmi.description import Description, describe
from hapticlink.orchestrator.scene.scene_tables import PowerPort, SetSpring
from tests.little_fmus import attributes
from tests.orchestrator.c_fmus import packed

K, C, K_C, C_C = 100.0, 1.0, 100.0, 1.0
START = np.array([0.0, 1.0, 1.0, 0.0])
"""x1, v1, x2, v2 at WARM."""
WARM = 0.06


def matrix(k_1: float, k_2: float, c: float, k_c: float, c_c: float) -> NDArray[np.float64]:
    """Of (x1, v1, x2, v2): masses of 1 kg on k_1 and k_2 and c, joined by k_c and c_c."""
    one = [-k_1 - k_c, -c - c_c, k_c, c_c]
    two = [k_c, c_c, -k_2 - k_c, -c - c_c]
    return np.array([[0.0, 1.0, 0.0, 0.0], one, [0.0, 0.0, 0.0, 1.0], two])


A = matrix(K, K, C, K_C, C_C)


def exact(times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([expm(A * (t - WARM)) @ START for t in times])


ROWS = [("two.F", "one.F"), ("one.x", "two.x1"), ("one.v", "two.v1")]

POWER = (PowerPort(effort="one.F", displacement="one.x"),)
SPRINGS = (
    SetSpring(
        set_position="two.x1", position="two.x", set_velocity="two.v1",
        stiffness=(K_C,), damping=(C_C,),
    ),
)  # fmt: skip

REALS = (
    "a", "b", "d", "x", "v", "acc", "F", "dF", "k", "c", "p", "q", "side", "warm", "sign",
    "brittle", "fine", "failure", "offered", "calls",
)  # fmt: skip
"""By value reference, as in mass_fmu.c."""
FLAGS = (
    "canHandleVariableCommunicationStepSize",
    "canGetAndSetFMUstate",
    "providesDirectionalDerivative",
)
INPUTS = {"one": {"a": "F"}, "two": {"a": "x1", "b": "v1", "d": "a1"}}
OUTPUTS = {
    "one": {"x": "x", "v": "v", "acc": "a", "calls": "calls"},
    "two": {"x": "x", "v": "v", "F": "F", "dF": "der(F)", "calls": "calls"},
}
DERIVATIVE_OF = {"v": "x", "a": "v"}
FEEDS = {"a": ["F"], "F": ["x1", "v1"], "der(F)": ["x1", "v1", "a1"]}
"""What an output depends on directly."""
COMMON = {"warm": WARM, "sign": 1.0, "offered": 1.0}
OWN = {
    "one": {"k": K, "c": C, "p": 1.0, "q": 0.0, "side": 1.0, **COMMON},
    "two": {"k": K + K_C, "c": C + C_C, "p": K_C, "q": C_C, "side": 2.0, **COMMON},
}


def native(
    folder: Path,
    name: str,
    flags: tuple[str, ...] = FLAGS,
    nominal: Mapping[str, float] | None = None,
    **values: float,
) -> Description:
    """`one` takes a force, `two` a motion, with parameters that differ from the oscillator's in
    `values`."""
    start = {**dict.fromkeys(REALS, 0.0), **OWN[name], **values}
    description = _description(name, flags, nominal or {}, start)
    return describe(packed(folder / f"{name}.fmu", "mass_fmu.c", description))


def held(folder: Path) -> dict[str, Description]:
    """Both masses, without directional derivatives."""
    return {n: native(folder, n, FLAGS[:2]) for n in ("one", "two")}


STIFF = (100.0, 300.0, 2e4, 200.0)


def stiff(
    folder: Path, k_1: float, k_2: float, k_c: float, c_c: float,
    flags: tuple[str, ...] = FLAGS[:2], **both: float,
) -> dict[str, Description]:  # fmt: skip
    """Unit masses on k_1 and k_2, at rest at 1 m, joined by k_c and c_c."""
    rest = {"warm": 0.0, "x": 1.0, **both}
    one = native(folder, "one", flags, k=k_1, c=0.0, **rest)
    two = native(folder, "two", flags, k=k_2 + k_c, c=c_c, p=k_c, q=c_c, a=1.0, **rest)
    return {"one": one, "two": two}


def _description(
    name: str, flags: tuple[str, ...], nominal: Mapping[str, float], start: Mapping[str, float]
) -> str:
    rows: list[str] = []
    places: dict[str, int] = {}
    for reference, real in enumerate(REALS):
        inputs, outputs = INPUTS[name], OUTPUTS[name]
        called = inputs.get(real) or outputs.get(real) or real
        if real in inputs:
            what, text = 'causality="input"', f'<Real start="{start[real]}"/>'
        elif real in outputs:
            size = f' nominal="{nominal[called]}"' if called in nominal else ""
            of = places.get(DERIVATIVE_OF.get(called, ""))
            size += f' derivative="{of}"' if of else ""
            what, text = 'causality="output"', f"<Real{size}/>"
        elif real in REALS[8:-1]:
            what = 'causality="parameter" variability="fixed"'
            text = f'<Real start="{start[real]}"/>'
        else:
            continue
        rows.append(
            f'<ScalarVariable name="{called}" valueReference="{reference}" {what}>{text}'
            "</ScalarVariable>"
        )
        places[called] = len(rows)
    unknowns = "".join(
        f'<Unknown index="{places[y]}" dependencies="'
        f'{" ".join(str(places[u]) for u in FEEDS.get(y, []))}"/>'
        for y in OUTPUTS[name].values()
    )
    capable, numbers = attributes(dict.fromkeys(flags, "true")), ",".join(map(repr, start.values()))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{numbers}"
 variableNamingConvention="structured">
<CoSimulation modelIdentifier="mass" {capable}/>
<ModelVariables>{"".join(rows)}</ModelVariables>
<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure>
</fmiModelDescription>
"""
