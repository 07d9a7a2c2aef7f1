"""FMUs of others for tests: those of pythonfmu, and archives and descriptions that are edited."""

import uuid
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pythonfmu.builder import FmuBuilder

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
