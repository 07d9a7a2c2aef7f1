"""Parameter sets, mappings and bindings of SSPs, as SSP 1.0 and 2.0 spell them."""

COMMON = 'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
VALUES = 'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
MAPPING = 'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"'


def values(*parameters: tuple[str, str], units: str = "") -> str:
    """A parameter set; a value is written as "0.5", or "0.5 mm"."""
    made = ""
    for name, text in parameters:
        number, _, unit = text.partition(" ")
        kind = "Boolean" if number in ("true", "false") else "Real"
        of = f' unit="{unit}"' if unit else ""
        made += f'<ssv:Parameter name="{name}"><ssv:{kind} value="{number}"{of}/></ssv:Parameter>'
    return (
        f'<ssv:ParameterSet version="1.0" name="p" {VALUES}><ssv:Parameters>{made}</ssv:Parameters>'
        f"{units}</ssv:ParameterSet>"
    )


def unit(name: str, metres: float) -> str:
    """The units of a parameter set: one, of length."""
    base = f'<ssc:BaseUnit m="1" factor="{metres}"/>'
    return f'<ssv:Units><ssc:Unit {COMMON} name="{name}">{base}</ssc:Unit></ssv:Units>'


def mapping(*entries: tuple[str, str, str], version: str = 'version="1.0"') -> str:
    """(source, target, transformation) of each entry."""
    made = "".join(
        f'<ssm:MappingEntry source="{a}" target="{b}">{t}</ssm:MappingEntry>' for a, b, t in entries
    )
    return f"<ssm:ParameterMapping {version} {MAPPING} {COMMON}>{made}</ssm:ParameterMapping>"


def linear(factor: float, offset: float) -> str:
    return f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'


def binding(set_: str = "", map_: str = "", about: str = "", map_about: str = "") -> str:
    inside = f"<ssd:ParameterValues>{set_}</ssd:ParameterValues>" if set_ else ""
    if map_ or map_about:
        inside += f"<ssd:ParameterMapping {map_about}>{map_}</ssd:ParameterMapping>"
    return f"<ssd:ParameterBinding {about}>{inside}</ssd:ParameterBinding>"


def bindings(*each: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(each)}</ssd:ParameterBindings>"


def parameters(*inside: str) -> str:
    """A parameter set of SSP 2.0, of the insides of its elements."""
    given = "".join(f"<ssv:Parameter {each}</ssv:Parameter>" for each in inside)
    set_ = f'<ssv:ParameterSet version="2.0" name="p" {VALUES} {COMMON}><ssv:Parameters>{given}'
    return f"{set_}</ssv:Parameters></ssv:ParameterSet>"


ON = bindings(binding(values(("on", "true"))))
TABLE = (
    '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
    "</ssc:BooleanMappingTransformation>"
)
