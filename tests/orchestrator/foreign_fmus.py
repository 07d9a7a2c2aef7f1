"""FMUs of others for tests: pythonfmu's and pythonfmu3's, and in C, where they fail on demand."""

import os
import re
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fmpy import platform, platform_tuple, sharedLibraryExtension
from pythonfmu.builder import FmuBuilder

from hapticlink.fmus.native import compile_library
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.results import tables

FOLDER = Path(__file__).parent
SLAVE = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.gain, self.steps, self.on = 0.0, 0.0, 1.0, 0, False
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Integer("steps", causality=Fmi2Causality.output))
        self.register_variable(Boolean("on", causality=Fmi2Causality.input))
        self.register_variable(Real("gain", causality=Fmi2Causality.parameter,
                                    variability=Fmi2Variability.tunable))

    def do_step(self, time, size):
        self.steps += 1
        {body}
        return True

    def terminate(self):
        {end}
        super().terminate()
"""


def python_fmu(
    folder: Path, name: str, body: str = "self.y = time + size", end: str = "", **options: bool
) -> Path:
    """An FMI 2.0 FMU: inputs u and on, outputs y and steps, parameter gain. `end` is run when it
    terminates.

    Its module has a name of its own, so that no FMU of another test is in its way.
    """
    text = SLAVE.format(name=name, body=body, end=end)
    return python_fmu_of(folder, text, uuid.uuid4().hex, **options)


GENERAL = """
from math import cos, nan, sin
from pythonfmu import (
    Boolean, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real, String)

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = {{}}
        for causality, starts in {variables}:
            for name, start in starts.items():
                self.add(Fmi2Causality[causality], name, start)

    def add(self, causality, name, start):
        kind = {{bool: Boolean, int: Integer, float: Real, str: String}}[type(start)]
        fixed = Fmi2Variability.fixed if causality == Fmi2Causality.parameter else None
        self.values[name] = start
        self.register_variable(kind(
            name, causality=causality, variability=fixed, initial={initial},
            getter=lambda: self.values[name], setter=lambda v: self.values.update({{name: v}})))

    def do_step(self, time, size):
        values, end = self.values, time + size
        {body}
        return True
"""
Starts = Mapping[str, bool | int | float | str]


def slave(
    folder: Path, name: str, *variables: tuple[str, Starts], body: str = "", initial: str = "None"
) -> Path:
    """An FMI 2.0 FMU of `variables`, (causality, start value of each name), of the types of their
    start values. `body` is run in a step to `end` (s), with all of them in `values`."""
    text = GENERAL.format(name=name, variables=variables, body=body, initial=initial)
    return python_fmu_of(folder, text, uuid.uuid4().hex)


def entries(name: str, size: int, each: Any = 0.0) -> dict[str, Any]:
    """The same, 0 by default, for each entry of a vector."""
    return {f"{name}[{i + 1}]": each for i in range(size)}


def python_fmu_of(folder: Path, text: str, module: str, **options: bool) -> Path:
    """The FMU of a slave's text, in a module of that name."""
    script = folder / f"m{module}.py"
    script.write_text(text)
    return Path(FmuBuilder.build_FMU(script, dest=folder, **options))


UNITS = """<UnitDefinitions>
<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
<Unit name="m"><BaseUnit m="1"/></Unit>
<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
<Unit name="K"><BaseUnit K="1"/></Unit>
<Unit name="deg"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit>
<Unit name="rad"><BaseUnit rad="1"/></Unit>
<Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
<Unit name="kN"><BaseUnit kg="1" m="1" s="-2" factor="1000"/></Unit>
<Unit name="furlong"/>
</UnitDefinitions>
<ModelVariables>"""


def edited(path: Path, change: Callable[[str], str]) -> Path:
    """The FMU with its modelDescription.xml changed."""
    name = "modelDescription.xml"
    return edited_entries(path, lambda all_: all_ | {name: change(all_[name].decode()).encode()})


def edited_entries(path: Path, change: Callable[[dict[str, bytes]], dict[str, bytes]]) -> Path:
    """The archive with other entries."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in change(entries).items():
            archive.writestr(name, content)
    return path


def with_units(path: Path, **units: str) -> Path:
    """The FMU with units of its Real variables."""

    def change(text: str) -> str:
        text = text.replace("<ModelVariables>", UNITS)
        for name, unit in units.items():
            head, tail = text.split(f'name="{name}"', 1)
            text = f'{head}name="{name}"' + tail.replace("<Real", f'<Real unit="{unit}"', 1)
        return text

    return edited(path, change)


HOSTILE = {
    "2": """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="hostile" guid="hostile">
<CoSimulation modelIdentifier="hostile" {flags}/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="slope" valueReference="2" causality="output"><Real/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/><Unknown index="3"/></Outputs></ModelStructure>
</fmiModelDescription>
""",
    "3": """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="hostile" instantiationToken="hostile">
<CoSimulation modelIdentifier="hostile" {flags}/>
<ModelVariables>
<Float64 name="u" valueReference="0" causality="input" start="0"/>
<Float64 name="y" valueReference="1" causality="output"/>
<Float64 name="slope" valueReference="2" causality="output"/>
</ModelVariables>
<ModelStructure><Output valueReference="1"/><Output valueReference="2"/></ModelStructure>
</fmiModelDescription>
""",
}
HOSTILE_LOG = "HOSTILE_FMU_LOG"
STATES = {"2": "canGetAndSetFMUstate", "3": "canGetAndSetFMUState"}


def hostile_fmu(folder: Path, fmi: str = "2", *options: str, **flags: str) -> Path:
    """The FMU of hostile_fmu.c, with capability flags; it can restore its state. What its instances
    do is in their names, "<place>_<act>_<step>"."""
    given = {STATES[fmi]: "true", "canHandleVariableCommunicationStepSize": "true"} | flags
    description = HOSTILE[fmi].format(flags=attributes(given))
    where = {"2": platform, "3": platform_tuple}[fmi]
    options = (f"-DFMI={fmi}", "-pthread", *options)
    return packed(folder / "hostile.fmu", "hostile_fmu.c", where, description, *options)


def hostile_scene(folder: Path, name: str, lines: str = "", fmu: str = "hostile") -> Path:
    """A scene in which the hostile FMU of that name gets the output of another one that behaves
    well; `lines` are further keys of it, `fmu` is its file."""
    both = fmu_table(name, fmu, lines) + fmu_table("source", "hostile")
    return scene(folder, both + wire_table("source.y", f"{name}.u"))


def attributes(given: Mapping[str, str]) -> str:
    return " ".join(f'{name}="{value}"' for name, value in given.items())


def packed(path: Path, source: str, where: str, description: str, *options: str) -> Path:
    """The FMU of a C file of this folder, with one binary."""
    if where == platform_tuple:
        options = (*options, str(FOLDER / "fmi3_rest.c"))
    found = re.search('modelIdentifier="(.*?)"', description)
    assert found
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        library = f"binaries/{where}/{found[1]}{sharedLibraryExtension}"
        archive.writestr(library, compiled(FOLDER / source, *options))
    return path


@cache
def compiled(source: Path, *options: str) -> bytes:
    """A C file as a shared library, with all its functions exported."""
    with tempfile.TemporaryDirectory() as room:
        exported = ["-fvisibility=default", *options]
        return compile_library(source, Path(room) / "library", options=exported).read_bytes()


NUMBERS = (
    "Float64", "Float32", "Int64", "Int32", "Int16", "Int8",
    "UInt64", "UInt32", "UInt16", "UInt8", "Boolean",
)  # fmt: skip  # in the order of types_fmu3.c


def c_fmu3(folder: Path) -> Path:
    """The FMU of types_fmu3.c: input in_<type> and output out_<type> of every number type of FMI
    3.0, a parameter text, a matrix whose size is a structural parameter, the weighted sum
    of its entries, and a binary input with its echo."""
    rows = []
    for k, kind in enumerate(NUMBERS):
        how = "continuous" if kind.startswith("Float") else "discrete"
        start = "false" if kind == "Boolean" else "0"
        rows += [
            f'<{kind} name="in_{kind}" valueReference="{2 * k}" causality="input" '
            f'variability="{how}" start="{start}"/>',
            f'<{kind} name="out_{kind}" valueReference="{2 * k + 1}" causality="output" '
            f'variability="{how}"/>',
        ]
    outputs = "".join(f'<Output valueReference="{2 * k + 1}"/>' for k in range(len(NUMBERS)))
    description = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="types" instantiationToken="{{types}}">
<CoSimulation modelIdentifier="types"/>
<ModelVariables>{"".join(rows)}
<String name="text" valueReference="23" causality="parameter" variability="fixed"><Start value=""/>
</String>
<UInt64 name="size" valueReference="24" causality="structuralParameter" variability="fixed"
 start="2"/>
<Float64 name="array" valueReference="25" causality="parameter" variability="fixed" start="0 0 0 0">
<Dimension valueReference="24"/><Dimension valueReference="24"/></Float64>
<Float64 name="sum" valueReference="26" causality="output" variability="continuous"/>
<Binary name="blob" valueReference="27" causality="input" variability="discrete"><Start value=""/>
</Binary>
<Binary name="echo" valueReference="28" causality="output" variability="discrete"/></ModelVariables>
<ModelStructure>{outputs}<Output valueReference="26"/><Output valueReference="28"/></ModelStructure>
</fmiModelDescription>
"""
    return packed(folder / "types.fmu", "types_fmu3.c", platform_tuple, description)


EVENTS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="events" instantiationToken="{token}">
<CoSimulation modelIdentifier="events" hasEventMode="true" canGetAndSetFMUState="true"
 canHandleVariableCommunicationStepSize="{varies}"/>
<ModelVariables>
<Float64 name="x" valueReference="1" causality="output"/>
<Float64 name="u" valueReference="2" causality="input" start="0"/>
<Int32 name="falls" valueReference="3" causality="output"/>
<Int32 name="alarms" valueReference="4" causality="output"/>
<Int32 name="level" valueReference="5" causality="input" start="0"/>
<Int32 name="parts" valueReference="6" causality="output"/>
<Int32 name="mode" valueReference="7" causality="parameter" variability="fixed" start="0"/>
<Int32 name="entered" valueReference="8" causality="output"/>
</ModelVariables>
<ModelStructure><Output valueReference="1"/><Output valueReference="3"/><Output valueReference="4"/>
<Output valueReference="6"/><Output valueReference="8"/></ModelStructure>
</fmiModelDescription>
"""


def event_fmu3(folder: Path, varies: bool = True, token: str = "{events}") -> Path:
    """The FMU of event_fmu3.c, which has event mode; `varies`: it takes steps of any size."""
    description = EVENTS.format(token=token, varies=str(varies).lower())
    return packed(folder / "events.fmu", "event_fmu3.c", platform_tuple, description)


CLOCKED = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="clocks" instantiationToken="clocks">
<CoSimulation modelIdentifier="clocks" {flags}/>
<ModelVariables>
<Clock name="sample" valueReference="0" causality="input" intervalVariability="constant"
 intervalDecimal="0.1" shiftDecimal="{shift}"/>
<Clock name="told" valueReference="1" causality="input" intervalVariability="fixed"/>
<Clock name="fired" valueReference="2" causality="output" intervalVariability="triggered"/>
<Clock name="go" valueReference="3" causality="input" intervalVariability="triggered"/>
<Clock name="later" valueReference="4" causality="input" intervalVariability="countdown"/>
<Clock name="grows" valueReference="5" causality="input" intervalVariability="changing"/>
<Float64 name="w" valueReference="20" causality="input" variability="discrete" clocks="0"
 start="0"/>
<Float64 name="held" valueReference="21" causality="output" variability="discrete" clocks="0"/>
<Float64 name="v" valueReference="22" causality="input" variability="discrete" clocks="3"
 start="0"/>
<Float64 name="got" valueReference="23" causality="output" variability="discrete" clocks="3"/>
<Float64 name="when" valueReference="24" causality="output" variability="discrete" clocks="4"/>
<Float64 name="plain" valueReference="25" causality="output"/>
{counts}</ModelVariables>
<ModelStructure/>
</fmiModelDescription>
"""
CLOCKS = ("sample", "told", "fired", "go", "later", "grows")


def clock_fmu3(folder: Path, shift: float = 0.05, **flags: str) -> Path:
    """The FMU of clock_fmu3.c, with clocks of every kind and how often each was active, that of
    0.1 s from `shift` (s) on; by default one with event mode that takes steps of any size."""
    flags = flags or {"hasEventMode": "true", "canHandleVariableCommunicationStepSize": "true"}
    counts = "".join(
        f'<Int32 name="{name}_count" valueReference="{30 + k}" causality="output" clocks="{k}"/>\n'
        for k, name in enumerate(CLOCKS)
    )
    description = CLOCKED.format(flags=attributes(flags), counts=counts, shift=shift)
    of = platform_tuple, description, f"-DSHIFT={shift}"
    return packed(folder / "clocks.fmu", "clock_fmu3.c", *of)


ISOLATED = "isolate = true\n"
COMMAND = [sys.executable, "-m", "hapticlink"]
RUN = [*COMMAND, "run", "--no-figures"]


def fmu_table(name: str, path: str, more: str = "") -> str:
    """An [[fmu]] table of a scene, with further lines."""
    return f'[[fmu]]\nname = "{name}"\npath = "{path}.fmu"\n{more}'


def wire_table(source: str, target: str, more: str = "") -> str:
    """A [[connection]] table of a scene, with further lines."""
    return f'[[connection]]\nfrom = "{source}"\nto = "{target}"\n{more}'


PAIR = (
    "\n"
    + fmu_table("gives", "Gives")
    + fmu_table("takes", "Takes")
    + wire_table("gives.y", "takes.u")
)


def scene(folder: Path, text: str, rate: int = 64, duration: float = 0.5) -> Path:
    """A scene file of [[fmu]] and [[connection]] tables."""
    path = folder / "scene.toml"
    head = f'title = "test"\nduration = {duration}\nhaptics.rate = {rate}\n'
    path.write_text(head + text)
    return path


def run(folder: Path, text: str, *options: str) -> tuple[Experiment, tables.Results]:
    experiment = simulate(str(scene(folder, text)), folder / "out", options)
    return experiment, experiment.results


def process(path: Path | str, out: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """`hapticlink run` of a scene, in a process of its own."""
    command, environment = [*RUN, str(path), "--out", str(out)], os.environ | environment
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def ran(folder: Path, text: str, *options: str) -> tables.Results:
    """The results of a run without a fault."""
    experiment, results = run(folder, text, *options)
    assert experiment.outcome.fault is None
    return results


def fault(folder: Path, text: str, *options: str) -> str:
    """What a run says of the fault that ended it."""
    experiment, _ = run(folder, text, *options)
    assert experiment.outcome.fault is not None
    return str(experiment.outcome.fault)
