"""What SSP 2.0 has and 1.0 has not: arrays, types of FMI 3.0, further kinds of connectors."""

import zipfile
from xml.etree import ElementTree

import pytest

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from tests.orchestrator.c_fmus import c_fmu3
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.run.test_energy import fmus
from tests.orchestrator.ssp.parameter_sets import binding, bindings, mapping, parameters
from tests.orchestrator.ssp.ssps import component, line, ssp, system
from tests.orchestrator.ssp.test_ssp import come_back


def array(name: str, kind: str, *sizes: str) -> str:
    """A connector of these dimensions, each 'size="2"', 'sizeConnector="n"' or ''."""
    each = "".join(f"<ssc:Dimension {size}/>" for size in sizes)
    connector = f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Float64/>{each}</ssd:Connector>'
    return f"<ssd:Connectors>{connector}</ssd:Connectors>"


SPRING = component("s", "Spring")


def moved(folder, root: str) -> str:
    fmus(folder, "m")
    made = {f"{n}_fmu": (folder / f"{n}.fmu").read_bytes() for n in ("Moves", "Spring")}
    return ssp(folder, root, **made)


def boxed(sizes: tuple[str, ...], inner: str, across: str) -> str:
    """Moves, with its path x[2], in a box with an array x; and Spring, with d[2]."""
    box = system("box", array("x", "output", *sizes), component("m", "Moves"), inner)
    return system("top", "", box + SPRING, across)


WHOLE, ACROSS = line("m.x", "x", "3 0"), line("box.x", "s.d")


@pytest.mark.parametrize("size", ['size="2"', 'sizeConnector="n"', ""])
def test_arrays_are_connected_whole_through_borders(tmp_path, size):
    """The size of a system's connector is that of the other end where it is left open."""
    path = moved(tmp_path, boxed((size,), WHOLE, ACROSS))
    (only,) = open_scene.load(path, ["haptics.rate=50"]).connection
    assert (only.from_, only.to, only.factor) == ("box_m.x", "s.d", 3.0)


def test_an_entry_is_connected_by_its_indices(tmp_path):
    first = line("m.x", "x", how='startIndices="2" endIndices="1 1"')
    across = line("box.x", "s.d", how='startIndices="1 1" endIndices="2"')
    path = moved(tmp_path, boxed(('size="1"', 'size="1"'), first, across))
    (only,) = open_scene.load(path, ["haptics.rate=50"]).connection
    assert (only.from_, only.to) == ("box_m.x[2]", "s.d[2]")


MATRIX = """name="array"><ssv:Float64 value="1 2 3 4 5 6 7 8 9"/><ssc:Dimension size="3"/>
<ssc:Dimension size="3"/>"""
SIZE = 'name="size"><ssv:UInt64 value="3"/>'
LARGE = 'name="in_Int64"><ssv:Int64 value="9007199254740991"/>'
TEXT = 'name="text"><ssv:String><ssv:Value value="two words"/></ssv:String>'


def typed(folder, bound: str, how: str = "") -> str:
    made = {"types_fmu": c_fmu3(folder).read_bytes()}
    one = component("a", "types", bindings(bound)).replace("source=", f"{how} source=", bool(how))
    two = component("p", "Plain")
    return ssp(folder, system("top", "", one + two, line("p.y", "p.u")), **made)


NAMED = mapping(("m", "array", ""), *((name, name, "") for name in ("size", "in_Int64", "text")))


@pytest.mark.parametrize(("name", "mapped"), [("array", ""), ("m", NAMED)])
def test_values_of_fmi_3_and_arrays_start_as_given(tmp_path, name, mapped):
    """A mapping takes an array whole."""
    given = parameters(SIZE, MATRIX.replace("array", name), LARGE, TEXT)
    path = typed(tmp_path, binding(given, mapped))
    ended = simulate(path, tmp_path / "out", ["haptics.rate=50"])
    found, (first, _) = ended.results.haptics, open_scene.load(path, ["haptics.rate=50"]).fmu
    assert found["a.sum"][-1] == sum(i * i for i in range(1, 10))
    assert found["a.out_Int64"][-1] == 2**53 - 1
    assert first.start["text"] == "two words"


@pytest.mark.parametrize(
    ("given", "how", "message"),
    [
        (MATRIX.replace(" 9", ""), "", r"parameter array: 8 values for 9 entries"),
        ('name="sum"><ssv:Float64 value="1 2"/>', "", "parameter sum: "),
        (MATRIX.replace("3", "300000000"), "", "at most 1000000 entries"),
        (LARGE.replace("Int64 v", "Int32 v"), "", "is no SSP 1.0 or 2.0"),
        (SIZE, 'implementation="ScheduledExecution"', "a is a Component for ScheduledExecution"),
    ],
)
def test_values_that_do_not_fit_are_refused(tmp_path, given, how, message):
    with pytest.raises(InputFault, match=message):
        open_scene.load(typed(tmp_path, binding(parameters(given)), how), ["haptics.rate=50"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('size="2"', 'size="3"', r"box\.m\.x and box\.x are connected, and have 2 and 3 entries"),
        (' source="resources/Moves.fmu"', "", r"box\.m is a Component without source"),
        ('kind="output"', 'kind="unspecified"', r"box\.x is unspecified"),
        ('size="2"', 'size="1000001"', "at most 1000000 entries"),
    ],
)
def test_structures_that_cannot_run_are_refused(tmp_path, old, new, message):
    root = boxed(('size="2"',), WHOLE, ACROSS)
    assert old in root
    with pytest.raises(InputFault, match=message):
        open_scene.load(moved(tmp_path, root.replace(old, new)), ["haptics.rate=50"])


def test_bytes_are_passed_on_by_a_line(tmp_path, monkeypatch):
    """The start value of one FMU reaches the other."""
    c_fmu3(tmp_path)
    log = tmp_path / "log"
    monkeypatch.setenv("TYPES_FMU_LOG", str(log))
    two = fmu_table("a", "types", 'start.blob = "00ff"\n') + fmu_table("b", "types")
    path = hl.export(scene(tmp_path, two + wire_table("a.echo", "b.blob")), out=tmp_path / "x.ssp")
    log.write_text("")
    assert simulate(str(path), tmp_path / "out").outcome.fault is None
    assert log.read_text().splitlines()[:2] == ["blob 00ff"] * 2


def test_a_scene_with_fmi_3_is_written_as_2_0_and_comes_back(tmp_path):
    """Arrays are connectors of their own; whole numbers of 64 bits are parameters."""
    hl.build("five-bar", out=tmp_path, as_one=True, fmi=3)
    c_fmu3(tmp_path)
    text = fmu_table("a", "five_bar") + fmu_table("b", "five_bar")
    text += fmu_table("c", "types", "start = { in_Int64 = 1099511627776 }\n")
    wire = wire_table("a.hand.F", "b.virtual_mechanism.F_drift", "factor = 0.5\n")
    tables = come_back(str(scene(tmp_path, text + wire)), tmp_path).haptics
    with zipfile.ZipFile(tmp_path / "ssp" / "scene.ssp") as archive:
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    assert root.get("version") == "2.0"
    found = {
        connector.get("name"): [d.get("size") for d in connector.iterfind("{*}Dimension")]
        for connector in root.iterfind(".//{*}Component[@name='b']/{*}Connectors/{*}Connector")
    }
    assert found["virtual_mechanism.q"] == ["4"]
    lines = [line.attrib for line in root.iterfind(".//{*}Connection")]
    assert [line["startConnector"] for line in lines] == ["hand.F"] * 3
    assert [line["endIndices"] for line in lines] == ["1", "2", "3"]
    assert tables["c.out_Int64"][-1] == 2**40
    moved = tables["b.virtual_mechanism.x"] - tables["a.virtual_mechanism.x"]
    assert abs(moved).max() > 1e-6
