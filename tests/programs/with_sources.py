"""FMUs of others that bring their C sources."""

from pathlib import Path

from tests.little_fmus import c_fmu, description2, edited_entries, listing

TABLE = Path(__file__).parent / "table"
VARIABLES = """
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
"""
OUTPUTS = (
    '<Unknown index="2" dependencies=""/><Unknown index="4" dependencies=""/>'
    '<Unknown index="8" dependencies=""/><Unknown index="9" dependencies=""/>'
)
MILLIMETRE = (
    '<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions>'
)


def table_fmu(folder: Path, gain: float = 2.5) -> Path:
    """The FMU of the folder `table`."""
    files = sorted(TABLE.rglob("*.[ch]"))
    compiled = [file for file in files if file.suffix == ".c"]
    steps = {"canHandleVariableCommunicationStepSize": "true"}
    text = description2("table", VARIABLES, OUTPUTS, **steps)
    text = text.replace("<ModelVariables>", f"{MILLIMETRE}<ModelVariables>")
    path = c_fmu(folder / "table.fmu", text, *compiled)
    more = {f"sources/{file.relative_to(TABLE)}": file.read_bytes() for file in files}
    more["resources/gain.txt"] = str(gain).encode()
    edited_entries(path, lambda found: found | more)
    return listing(path, {str(file.relative_to(TABLE)): None for file in compiled})
