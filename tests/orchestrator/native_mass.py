"""The two masses of `oscillator` as compiled FMUs that take inputs varying within a step."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

from fmpy import platform, sharedLibraryExtension

from hapticlink.orchestrator.fmi.description import Description, describe
from tests.orchestrator import oscillator
from tests.orchestrator.compiled import compiled

REALS = (
    "a", "b", "d", "x", "v", "acc", "F", "dF", "k", "c", "p", "q", "side", "warm", "sign",
    "brittle", "fine", "failure", "offered", "calls",
)  # fmt: skip
"""By value reference, as in mass_fmu.c."""
FLAGS = (
    "canInterpolateInputs",
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
K, C, K_C, C_C = oscillator.K, oscillator.C, oscillator.K_C, oscillator.C_C
COMMON = {"warm": oscillator.WARM, "sign": 1.0, "offered": 1.0}
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
    path, numbers = folder / f"{name}.fmu", ",".join(map(repr, start.values()))
    library = compiled("mass_fmu.c", folder, name, f"-DSTART={numbers}")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _description(name, flags, nominal or {}, start))
        archive.write(library, f"binaries/{platform}/mass{sharedLibraryExtension}")
    return describe(path)


def held(folder: Path) -> dict[str, Description]:
    """Both masses with inputs that are constant within a step."""
    return {n: native(folder, n, FLAGS[1:3]) for n in ("one", "two")}


STIFF = (100.0, 300.0, 2e4, 200.0)


def stiff(
    folder: Path, k_1: float, k_2: float, k_c: float, c_c: float,
    flags: tuple[str, ...] = FLAGS[1:3], **both: float,
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
    capable = " ".join(f'{flag}="true"' for flag in flags)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="mass"
 variableNamingConvention="structured">
<CoSimulation modelIdentifier="mass" {capable}/>
<ModelVariables>{"".join(rows)}</ModelVariables>
<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure>
</fmiModelDescription>
"""
