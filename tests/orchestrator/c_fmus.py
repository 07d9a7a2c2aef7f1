"""FMUs of the C files of this folder: of FMI 2.0 and FMI 3.0, and one that fails on demand."""

from pathlib import Path

from tests.little_fmus import c_fmu, description2, description3

FOLDER = Path(__file__).parent


HOSTILE = """
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="slope" valueReference="2" causality="output"><Real/></ScalarVariable>
"""
HOSTILE3 = """
<Float64 name="u" valueReference="0" causality="input" start="0"/>
<Float64 name="y" valueReference="1" causality="output"/>
<Float64 name="slope" valueReference="2" causality="output"/>
"""
HOSTILE_LOG = "HOSTILE_FMU_LOG"
STATES = {"2": "canGetAndSetFMUstate", "3": "canGetAndSetFMUState"}


def hostile_description(fmi: str, **flags: str) -> str:
    """The description of the FMU of hostile_fmu.c."""
    if fmi == "3":
        return description3("hostile", HOSTILE3, (1, 2), **flags)
    outputs = '<Unknown index="2"/><Unknown index="3"/>'
    return description2("hostile", HOSTILE, outputs, **flags)


def hostile_fmu(folder: Path, fmi: str = "2", *options: str, **flags: str) -> Path:
    """The FMU of hostile_fmu.c, with capability flags; it can restore its state. What its instances
    do is in their names, "<place>_<act>_<step>"."""
    given = {STATES[fmi]: "true", "canHandleVariableCommunicationStepSize": "true"} | flags
    options = (f"-DFMI={fmi}", "-pthread", *options)
    description = hostile_description(fmi, **given)
    return packed(folder / "hostile.fmu", "hostile_fmu.c", description, *options)


def packed(path: Path, source: str, description: str, *options: str) -> Path:
    """The FMU of a C file of this folder, and of what FMI 3.0 asks for besides."""
    rest = [FOLDER / "fmi3_rest.c"] if 'fmiVersion="3.0"' in description else []
    return c_fmu(path, description, FOLDER / source, *rest, options=options)


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
    variables = f"""{"".join(rows)}
<String name="text" valueReference="23" causality="parameter" variability="fixed"><Start value=""/>
</String>
<UInt64 name="size" valueReference="24" causality="structuralParameter" variability="fixed"
 start="2"/>
<Float64 name="array" valueReference="25" causality="parameter" variability="fixed" start="0 0 0 0">
<Dimension valueReference="24"/><Dimension valueReference="24"/></Float64>
<Float64 name="sum" valueReference="26" causality="output" variability="continuous"/>
<Binary name="blob" valueReference="27" causality="input" variability="discrete"><Start value=""/>
</Binary>
<Binary name="echo" valueReference="28" causality="output" variability="discrete"/>"""
    description = description3("types", variables, (*range(1, 2 * len(NUMBERS), 2), 26, 28))
    return packed(folder / "types.fmu", "types_fmu3.c", description)


EVENTS = """
<Float64 name="x" valueReference="1" causality="output"/>
<Float64 name="u" valueReference="2" causality="input" start="0"/>
<Int32 name="falls" valueReference="3" causality="output"/>
<Int32 name="alarms" valueReference="4" causality="output"/>
<Int32 name="level" valueReference="5" causality="input" start="0"/>
<Int32 name="parts" valueReference="6" causality="output"/>
<Int32 name="mode" valueReference="7" causality="parameter" variability="fixed" start="0"/>
<Int32 name="entered" valueReference="8" causality="output"/>
"""


def event_fmu3(folder: Path, varies: bool = True, token: str = "") -> Path:
    """The FMU of event_fmu3.c, which has event mode; `varies`: it takes steps of any size."""
    flags = {
        "hasEventMode": "true", "canGetAndSetFMUState": "true", "canSerializeFMUState": "true",
    }  # fmt: skip
    flags["canHandleVariableCommunicationStepSize"] = str(varies).lower()
    description = description3("events", EVENTS, (1, 3, 4, 6, 8), token, **flags)
    return packed(folder / "events.fmu", "event_fmu3.c", description)


OUTPUTS = ("falls", "alarms", "seen", "completed", "entered", "beyond")
PARAMETERS = {"k": 2.0, "level": 0.5, "top": 1.0, "every": 0.0, "w": 0.0, "mode": 0.0, "from": 0.1}


def equations_fmu(folder: Path, fmi: str = "2", completes: bool = False) -> Path:
    """The FMU of equations_fmu.c, for model exchange. completes: it is told of completed steps."""
    about = [
        ("x", "output", "continuous", "exact", 1.0),
        ("der(x)", "local", "continuous", "calculated", None),
        ("u", "input", "continuous", None, 0.0),
        *((n, "parameter", "tunable", "exact", start) for n, start in PARAMETERS.items()),
        *((name, "output", "discrete", "calculated", None) for name in OUTPUTS),
    ]
    rows = []
    for k, (name, causality, variability, initial, start) in enumerate(about):
        if name == "w":
            causality, variability, initial = "input", "discrete", None
        inner = "".join(
            f' {key}="{value}"'
            for key, value in (
                ("start", start),
                ("derivative", (k if fmi == "2" else 0) if name == "der(x)" else None),
            )
            if value is not None
        )
        outer = (
            f'name="{name}" valueReference="{k}" causality="{causality}" '
            f'variability="{variability}"' + (f' initial="{initial}"' if initial else "")
        )
        if fmi == "2":
            rows.append(f"<ScalarVariable {outer}><Real{inner}/></ScalarVariable>")
        else:
            rows.append(f"<Float64 {outer}{inner}/>")
    shown = (0, *range(len(about) - len(OUTPUTS), len(about)))
    if fmi == "2":
        outputs = "".join(f'<Unknown index="{k + 1}"/>' for k in shown)
        text = description2(
            "equations", "".join(rows), outputs, canGetAndSetFMUstate="true",
            completedIntegratorStepNotNeeded=str(not completes).lower(),
        )  # fmt: skip
        derivatives = '</Outputs><Derivatives><Unknown index="2"/></Derivatives>'
        text = text.replace("</Outputs>", derivatives)
        text = text.replace('guid="', 'numberOfEventIndicators="1" guid="')
    else:
        text = description3(
            "equations", "".join(rows), shown, canGetAndSetFMUState="true",
            needsCompletedIntegratorStep=str(completes).lower(),
        )  # fmt: skip
        more = '<ContinuousStateDerivative valueReference="1"/>'
        last = '<EventIndicator valueReference="0"/></ModelStructure>'
        text = text.replace("</ModelStructure>", more + last)
    text = text.replace("CoSimulation", "ModelExchange")
    return packed(folder / "equations.fmu", "equations_fmu.c", text, f"-DFMI={fmi}")


TOLD = ("stop", "tolerance", "ramp", "forward")


def told_fmu3(folder: Path, **flags: str) -> Path:
    """The FMU of told_fmu3.c, which puts out what it is told of the experiment."""
    variables = "".join(
        f'<Float64 name="{name}" valueReference="{k}" causality="output"/>'
        for k, name in enumerate(TOLD)
    )
    return packed(
        folder / "Told.fmu", "told_fmu3.c", description3("Told", variables, range(4), **flags)
    )


CLOCKED = """
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
{counts}"""
CLOCKS = ("sample", "told", "fired", "go", "later", "grows")


def clock_fmu3(folder: Path, shift: float = 0.05, **flags: str) -> Path:
    """The FMU of clock_fmu3.c, with clocks of every kind and how often each was active, that of
    0.1 s from `shift` (s) on; by default one with event mode that takes steps of any size."""
    flags = flags or {"hasEventMode": "true", "canHandleVariableCommunicationStepSize": "true"}
    counts = "".join(
        f'<Int32 name="{name}_count" valueReference="{30 + k}" causality="output" clocks="{k}"/>\n'
        for k, name in enumerate(CLOCKS)
    )
    variables = CLOCKED.format(counts=counts, shift=shift)
    description = description3("clocks", variables, (), **flags)
    return packed(folder / "clocks.fmu", "clock_fmu3.c", description, f"-DSHIFT={shift}")
