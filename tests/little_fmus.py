"""Little FMUs for tests, by one maker each: of Python (pythonfmu, pythonfmu3), of a C file, and of
an FMU that is there, with another description, other entries or its sources."""

import re
import tempfile
import uuid
import zipfile
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fmpy import platform, platform_tuple, sharedLibraryExtension
from pythonfmu.builder import FmuBuilder

from hapticlink.fmus.native import compile_library

# --- of Python ---------------------------------------------------------------------------------

SLAVE = """
from math import cos, nan, sin
from pythonfmu import (
    Boolean, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real, String)

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for causality, starts in {variables}:
            for name, start in starts.items():
                self.add(causality, name, start)

    def add(self, causality, name, start):
        kind = {{bool: Boolean, int: Integer, float: Real, str: String}}[type(start)]
        variability = {{"parameter": "fixed", "tunable": "tunable"}}.get(causality)
        values = self.__dict__
        values[name] = start
        self.register_variable(kind(
            name, causality=Fmi2Causality["parameter" if variability else causality],
            variability=variability and Fmi2Variability[variability], initial={initial},
            getter=lambda: values[name], setter=lambda v: values.update({{name: v}})))

    def do_step(self, time, size):
        values, end = self.__dict__, time + size
        {body}
        return True

    def terminate(self):
        {end}
        super().terminate()
"""
Starts = Mapping[str, bool | int | float | str]


def slave(
    folder: Path,
    name: str,
    *variables: tuple[str, Starts],
    body: str = "",
    initial: str = "None",
    end: str = "",
    **options: bool,
) -> Path:
    """An FMI 2.0 FMU of `variables`: (causality, start value of each name), of the types of their
    start values; the causality "tunable" is that of tunable parameters. `body` is run in a step
    from `time` to `end` (s), with each of them as an attribute of `self` and in `values`; `end` is
    run when it terminates.

    Its module has a name of its own, so that no FMU of another test is in its way.
    """
    text = SLAVE.format(name=name, variables=variables, body=body, initial=initial, end=end)
    return python_fmu_of(folder, text, uuid.uuid4().hex, **options)


PLAIN: tuple[tuple[str, Starts], ...] = (
    ("input", {"u": 0.0}),
    ("output", {"y": 0.0, "steps": 0}),
    ("input", {"on": False}),
    ("tunable", {"gain": 1.0}),
)


def python_fmu(
    folder: Path, name: str, body: str = "self.y = time + size", end: str = "", **options: bool
) -> Path:
    """One with inputs u and on, outputs y and steps, which counts them, and parameter gain."""
    return slave(folder, name, *PLAIN, body=f"self.steps += 1\n        {body}", end=end, **options)


def entries(name: str, size: int, each: Any = 0.0) -> dict[str, Any]:
    """The same, 0 by default, for each entry of a vector."""
    return {f"{name}[{i + 1}]": each for i in range(size)}


def python_fmu_of(folder: Path, text: str, module: str, fmi: str = "2", **options: bool) -> Path:
    """The FMU of a slave's text, in a module of that name."""
    builder: Any = FmuBuilder
    if fmi == "3":
        from pythonfmu3.builder import FmuBuilder as builder
    script = folder / f"m{module}.py"
    script.write_text(text)
    return Path(builder.build_FMU(script, dest=folder, **options))


# --- of a C file -------------------------------------------------------------------------------


def attributes(given: Mapping[str, str]) -> str:
    return " ".join(f'{name}="{value}"' for name, value in given.items())


def description2(name: str, variables: str, outputs: str, guid: str = "", **flags: str) -> str:
    """The modelDescription.xml of an FMU of FMI 2.0, of the texts of its variables and Unknowns."""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{guid or name}">
<CoSimulation modelIdentifier="{name}" {attributes(flags)}/>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure>
</fmiModelDescription>
"""


def description3(
    name: str, variables: str, outputs: Iterable[int], token: str = "", **flags: str
) -> str:
    """The modelDescription.xml of an FMU of FMI 3.0."""
    given = "".join(f'<Output valueReference="{reference}"/>' for reference in outputs)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token or name}">
<CoSimulation modelIdentifier="{name}" {attributes(flags)}/>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure>{given}</ModelStructure>
</fmiModelDescription>
"""


def c_fmu(path: Path, description: str, *sources: Path, options: Iterable[str] = ()) -> Path:
    """The FMU of C files with one binary, that of this machine."""
    where = platform_tuple if 'fmiVersion="3.0"' in description else platform
    found = re.search('modelIdentifier="(.*?)"', description)
    assert found
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        library = f"binaries/{where}/{found[1]}{sharedLibraryExtension}"
        archive.writestr(library, compiled(*sources, options=tuple(options)))
    return path


@cache
def compiled(*sources: Path, options: tuple[str, ...] = ()) -> bytes:
    """C files as a shared library, with all their functions exported."""
    with tempfile.TemporaryDirectory() as room:
        exported = ["-fvisibility=default", *options]
        return compile_library(sources, Path(room) / "library", options=exported).read_bytes()


# --- of another FMU ----------------------------------------------------------------------------

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


def listing(path: Path, files: Mapping[str, str | None]) -> Path:
    """The FMU with SourceFiles: the text of each, None for those that are in it."""
    rows = "".join(f'<File name="{name}"/>' for name in files)

    def change(found: dict[str, bytes]) -> dict[str, bytes]:
        texts = {f"sources/{n}": text.encode() for n, text in files.items() if text is not None}
        head, key, tail = found["modelDescription.xml"].decode().partition("<CoSimulation")
        element, _, rest = tail.partition("/>")
        listed = f"{head}{key}{element}><SourceFiles>{rows}</SourceFiles></CoSimulation>{rest}"
        return {**found, "modelDescription.xml": listed.encode(), **texts}

    return edited_entries(path, change)
