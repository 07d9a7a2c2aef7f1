"""FMUs of others that bring their C sources."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from fmpy import platform

from hapticlink.fmus.native.compiler import compile_library, entry

TABLE = Path(__file__).parent / "table"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="table" guid="table">
<CoSimulation modelIdentifier="table" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real unit="mm"/></ScalarVariable>
<ScalarVariable name="scale" valueReference="2" causality="parameter" variability="tunable">
<Real start="1"/></ScalarVariable>
<ScalarVariable name="steps" valueReference="3" causality="output" variability="discrete">
<Integer/></ScalarVariable>
<ScalarVariable name="most" valueReference="4" causality="parameter" variability="fixed">
<Integer start="1000000"/></ScalarVariable>
<ScalarVariable name="on" valueReference="5" causality="input" variability="discrete">
<Boolean start="true"/></ScalarVariable>
<ScalarVariable name="text" valueReference="6" causality="parameter" variability="fixed">
<String start=""/></ScalarVariable>
<ScalarVariable name="gain" valueReference="7" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="size" valueReference="8" causality="output" variability="discrete">
<Integer/></ScalarVariable>
<ScalarVariable name="failure" valueReference="9" causality="parameter" variability="fixed">
<Integer start="3"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies=""/><Unknown index="4" dependencies=""/>
<Unknown index="8" dependencies=""/><Unknown index="9" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def table_fmu(folder: Path, gain: float = 2.5) -> Path:
    """The FMU of the folder `table`."""
    path, files = folder / "table.fmu", sorted(TABLE.rglob("*.[ch]"))
    compiled = [file for file in files if file.suffix == ".c"]
    with tempfile.TemporaryDirectory() as room, zipfile.ZipFile(path, "w") as archive:
        library = Path(room) / "library"
        compile_library(compiled, library, options=["-fvisibility=default"])
        archive.write(library, entry(platform, "table"))
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.writestr("resources/gain.txt", str(gain))
        for file in files:
            archive.write(file, f"sources/{file.relative_to(TABLE)}")
    return listing(path, {str(file.relative_to(TABLE)): None for file in compiled})


def listing(path: Path, files: Mapping[str, str | None]) -> Path:
    """The FMU with SourceFiles: the text of each, None for those that are in it."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    rows = "".join(f'<File name="{name}"/>' for name in files)
    head, found, tail = entries["modelDescription.xml"].decode().partition("<CoSimulation")
    element, _, rest = tail.partition("/>")
    listed = f"{head}{found}{element}><SourceFiles>{rows}</SourceFiles></CoSimulation>{rest}"
    entries["modelDescription.xml"] = listed.encode()
    for name, text in files.items():
        if text is not None:
            entries[f"sources/{name}"] = text.encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return path
