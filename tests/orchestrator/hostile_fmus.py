"""FMUs of hostile_fmu.c, which behave badly on demand, of FMI 2.0 and FMI 3.0."""

import zipfile
from pathlib import Path

from fmpy import platform, platform_tuple

from tests.orchestrator.compiled import compiled

DESCRIPTIONS = {
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
STATES = {"2": "canGetAndSetFMUstate", "3": "canGetAndSetFMUState"}
SCENE = """title = "hostile"
duration = 0.5
haptics.rate = 64
[[fmu]]
name = "{name}"
path = "{fmu}"
{lines}
[[fmu]]
name = "source"
path = "hostile.fmu"
[[connection]]
from = "source.y"
to = "{name}.u"
"""


def hostile_fmu(folder: Path, fmi: str = "2", **flags: str) -> Path:
    """The FMU, `hostile.fmu` in `folder`, with capability flags; it can restore its state."""
    given = {STATES[fmi]: "true", "canHandleVariableCommunicationStepSize": "true"} | flags
    library = compiled("hostile_fmu.c", folder, "hostile", f"-DFMI={fmi}", "-pthread")
    path = folder / "hostile.fmu"
    text = DESCRIPTIONS[fmi].format(flags=" ".join(f'{k}="{v}"' for k, v in given.items()))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        where = {"2": platform, "3": platform_tuple}[fmi]
        archive.write(library, f"binaries/{where}/{library.name}")
    return path


def hostile_scene(folder: Path, name: str, lines: str = "", fmu: str = "hostile.fmu") -> Path:
    """A scene in which the FMU of that name, "<place>_<act>_<step>", gets the output of another
    one that behaves well; `lines` are further keys of it, `fmu` is its file."""
    path = folder / "hostile.toml"
    path.write_text(SCENE.format(name=name, lines=lines, fmu=fmu))
    return path
