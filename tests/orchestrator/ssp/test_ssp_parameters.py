"""Parameters of SSPs: bindings, mappings and units, every value by hand from SSP 1.0."""

from pathlib import Path

import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from tests.orchestrator.ssp.parameter_sets import (
    ON,
    TABLE,
    binding,
    bindings,
    linear,
    mapping,
    unit,
    values,
)
from tests.orchestrator.ssp.ssps import component, connectors, line, ssp, system

PARAMETERS = system(
    "top",
    connectors(lid="input m"),
    system(
        "box",
        connectors(strength="parameter", u="input"),
        component("p", "Plain", bindings(binding(values(("gain", "7"), ("u", "3")))))
        + component("q", "Plain"),
        line("strength", "p.gain", "2 1") + line("strength", "q.gain") + line("u", "p.u"),
        "{box}",
    )
    + component("t", "Takes", ON)
    + component("g", "Gives", "{gives}"),
    line("lid", "t.u"),
    "{top}",
)


def starts(
    folder: Path, box: str = "", top: str = "", gives: str = "", **entries: str
) -> dict[str, dict[str, object]]:
    root = PARAMETERS.replace("{box}", box).replace("{top}", top).replace("{gives}", gives)
    read = open_scene.load(ssp(folder, root, **entries), ["haptics.rate=50"])
    return {f.name: dict(f.start) for f in read.fmu}


def test_bindings_of_a_system_reach_its_parts_and_go_before_theirs(tmp_path):
    twice = bindings(binding(values(("p.u", "4"))), binding(values(("p.u", "5"))))
    found = starts(tmp_path, box=twice)
    assert found["box_p"] == {"gain": 7.0, "u": 5.0}
    found = starts(
        tmp_path,
        box=bindings(binding(values(("strength", "0.5"), ("u", "4")))),
        top=bindings(
            binding(values(("u", "6")), about='prefix="box."'),
            binding(values(("box.q.u", "9"), ("t.on", "false"))),
        ),
    )
    assert found["box_p"] == {"gain": 2 * 0.5 + 1, "u": 6.0}
    assert found["box_q"] == {"gain": 0.5, "u": 9.0}
    assert found["t"] == {"on": False}


def test_a_mapping_renames_scales_and_leaves_out(tmp_path):
    given = values(("stiff", "0.5"), ("start", "3"), ("t.on", "false"))
    mapped = mapping(
        ("x.stiff", "box.strength", linear(4, 1)),
        ("x.stiff", "box.q.u", ""),
        ("x.start", "box.p.u", linear(-1, 0)),
    )
    bound = binding(given, mapped, about='prefix="x."')
    found = starts(tmp_path, top=bindings(bound))
    assert found["box_p"] == {"gain": 2 * (4 * 0.5 + 1) + 1, "u": -3.0}
    assert found["box_q"] == {"gain": 3.0, "u": 0.5}
    assert found["t"] == {"on": True}
    external = binding(
        about='source="resources/v.ssv" prefix="x."', map_about='source="resources/m.ssm"'
    )
    assert starts(tmp_path, top=bindings(external), v_ssv=given, m_ssm=mapped) == found


def test_a_value_in_a_unit_is_converted_to_that_of_its_variable(tmp_path):
    found = starts(
        tmp_path,
        top=bindings(binding(values(("lid", "50 cm")))),
        gives=bindings(binding(values(("gain", "2 inch"), units=unit("inch", 0.0254)))),
    )
    assert found["t"]["u"] == 0.5
    assert found["g"]["gain"] == pytest.approx(0.0508, rel=1e-15)
    # Plain says no unit, so that of its connector counts.
    bound = connectors(gain="parameter cm") + bindings(binding(values(("gain", "30 mm"))))
    root = component("p", "Plain", bound) + component("q", "Plain")
    root = system("top", "", root, line("p.y", "q.u"))
    plain, _ = open_scene.load(ssp(tmp_path, root), ["haptics.rate=50"]).fmu
    assert plain.start["gain"] == pytest.approx(3.0, rel=1e-15)
    scaled = binding(values(("gain", "30 mm")), mapping(("gain", "gain", linear(2, 1))))
    raw = scaled.replace("<ssm:MappingEntry", '<ssm:MappingEntry suppressUnitConversion="true"')
    assert starts(tmp_path, gives=bindings(scaled))["g"]["gain"] == pytest.approx(1.06, rel=1e-15)
    assert starts(tmp_path, gives=bindings(raw))["g"]["gain"] == 61.0


def test_what_omsimulator_leaves_out_of_an_inner_mapping_is_not_asked_for(tmp_path):
    inner = binding(values(("a", "2")), mapping(("a", "u", ""), version=""))
    assert starts(tmp_path, box=bindings(inner))["box_p"]["u"] == 2.0


def test_an_item_of_an_enumeration_goes_by_its_name(tmp_path):
    item = values(("gain", "2")).replace("ssv:Real", "ssv:Enumeration")
    assert starts(tmp_path, gives=bindings(binding(item)))["g"]["gain"] == "2"


def table(kind: str, **targets: str) -> str:
    entries = "".join(
        f'<ssc:MapEntry source="{a.lstrip("_")}" target="{b}"/>' for a, b in targets.items()
    )
    return f"<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>"


def test_a_table_of_a_mapping_replaces_what_it_contains(tmp_path):
    given = values(("on", "true"), ("n", "2"), ("m", "3"), ("item", "slow"))
    for name, kind in (("n", "Integer"), ("m", "Integer"), ("item", "Enumeration")):
        old = f'"{name}"><ssv:Real'
        given = given.replace(old, f'"{name}"><ssv:{kind}')
    mapped = mapping(
        ("on", "t.on", table("Boolean", true="0")),
        ("n", "box.p.u", table("Integer", _2="7", _4="8")),
        ("m", "box.q.u", table("Integer", _2="7")),
        ("item", "g.gain", table("Enumeration", slow="1", fast="2")),
    )
    found = starts(tmp_path, top=bindings(binding(given, mapped)))
    assert found["t"]["on"] is False
    assert (found["box_p"]["u"], found["box_q"]["u"]) == (7, 3)
    assert found["g"]["gain"] == "1"


def test_values_that_match_nothing_are_passed_over_and_told(tmp_path, caplog):
    bound = binding(
        values(("gain", "2"), ("lost", "1")), mapping(("lost", "away", ""), ("no", "u", ""))
    )
    assert starts(tmp_path, box=bindings(bound))["box_p"]["gain"] == 7.0
    assert "ignored: box.no, box.away" in caplog.text


def test_of_what_is_passed_over_few_are_told_without_escape_codes(tmp_path, caplog):
    bound = binding(values(*((f"&#155;31m{i}", "1") for i in range(1000))))
    starts(tmp_path, box=bindings(bound))
    assert "box.\\x9b31m19 and 980 more" in caplog.text


@pytest.mark.parametrize(
    ("bound", "message"),
    [
        (binding(values(("gain", "1 N"))), r"parameter g\.gain does not fit: kg\.m\.s-2 is not m"),
        (binding(values(("gain", "true")), mapping(("gain", "gain", linear(2, 0)))), "no number"),
        (binding(values(("gain", "1")), mapping(("gain", "gain", TABLE))),
         r"parameter gain: 1\.0 is no Boolean, of which its mapping has a table"),
        (binding(values(("a", "1"), ("b", "1")), mapping(("a", "gain", ""), ("b", "gain", ""))),
         r"two parameters are mapped to g\.gain"),
        (binding(values(("gain", "much"))), "is no SSP 1.0"),
        (binding(about='source="resources/no.ssv"'), "holds no resources/no.ssv"),
        (binding(about='source="../v.ssv"'), r"holds no \.\./v\.ssv"),
        (binding(about='source="v.ssv" sourceBase="component"'), "is inside an FMU"),
        (binding(), "neither source nor content"),
        (binding(about='source="resources/v.ssv"'), "declares a document type"),
    ],
)  # fmt: skip
def test_parameters_that_cannot_be_read_are_refused(tmp_path, bound, message):
    bomb = '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'
    with pytest.raises(InputFault, match=message):
        starts(tmp_path, gives=bindings(bound), v_ssv=bomb)
