"""SSPs of others, written out: systems, connections and parameters as SSP 1.0 spells them."""

import zipfile
from pathlib import Path

from tests.little_fmus import edited_entries, python_fmu, with_units
from tests.orchestrator.ssp.parameter_sets import ON, binding, bindings, values

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="nested"
 xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping">
"""
TAIL = """
<ssd:Units>
<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
<ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit>
<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
<ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
</ssd:Units>
<ssd:DefaultExperiment startTime="0.0" stopTime="0.2"/>
</ssd:SystemStructureDescription>"""


def connectors(**kinds: str) -> str:
    """`name="kind"` or `name="kind unit"`."""
    made = []
    for name, text in kinds.items():
        kind, _, unit = text.partition(" ")
        real = f'<ssc:Real unit="{unit}"/>' if unit else "<ssc:Real/>"
        made.append(f'<ssd:Connector name="{name}" kind="{kind}">{real}</ssd:Connector>')
    return f"<ssd:Connectors>{''.join(made)}</ssd:Connectors>"


def component(name: str, fmu: str, bindings: str = "") -> str:
    return f'<ssd:Component name="{name}" source="resources/{fmu}.fmu">{bindings}</ssd:Component>'


def system(name: str, ports: str, elements: str, lines: str, bindings: str = "") -> str:
    inside = f"<ssd:Elements>{elements}</ssd:Elements><ssd:Connections>{lines}</ssd:Connections>"
    return f'<ssd:System name="{name}">{ports}{bindings}{inside}</ssd:System>'


def line(start: str, end: str, linear: str = "", how: str = "") -> str:
    """`element.connector`, or `connector` of the system itself; linear is "factor offset"."""
    text = ""
    for which, (element, _, connector) in (
        ("start", start.rpartition(".")),
        ("end", end.rpartition(".")),
    ):
        text += f' {which}Element="{element}"' if element else ""
        text += f' {which}Connector="{connector}"'
    inside = ""
    if linear:
        factor, offset = linear.split()
        inside = f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'
    return f"<ssd:Connection{text} {how}>{inside}</ssd:Connection>"


def ssp(folder: Path, root: str, tail: str = TAIL, **entries: str | bytes) -> str:
    """Gives puts out 1000 gain (mm), Takes what it gets (m), Plain what it gets, times gain."""
    with_units(python_fmu(folder, "Gives", "self.y = 1000.0 * self.gain"), y="mm", gain="m")
    with_units(python_fmu(folder, "Takes", "self.y = self.u if self.on else -1.0"), u="m")
    python_fmu(folder, "Plain", "self.y = self.gain * self.u")
    with zipfile.ZipFile(folder / "their.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", HEAD + root + tail)
        for name, text in entries.items():
            archive.writestr(f"resources/{name.replace('_', '.')}", text)
        for name in ("Gives.fmu", "Takes.fmu", "Plain.fmu"):
            archive.write(folder / name, f"resources/{name}")
    return str(folder / "their.ssp")


GIVES = connectors(y="output mm") + bindings(binding(about='source="resources/a.ssv"'))
FOREIGN = system(
    "top",
    "",
    component("a b", "Gives", GIVES) + component("c", "Takes", connectors(u="input") + ON),
    line("a b.y", "c.u", "2.0 1.0"),
)
UNTIMED = "</ssd:SystemStructureDescription>"


def foreign(folder: Path, old: str = "", new: str = "") -> str:
    """An SSP without times: `a b` gives 500 mm, `c` takes twice that in m, plus 1. Of its
    description, `new` stands for `old`."""
    path = ssp(folder, FOREIGN, UNTIMED, a_ssv=values(("gain", "0.5")))
    name = "SystemStructure.ssd"

    def change(all_: dict[str, bytes]) -> dict[str, bytes]:
        assert old.encode() in all_[name]
        return all_ | {name: all_[name].replace(old.encode(), new.encode()) if old else all_[name]}

    return str(edited_entries(Path(path), change))
