"""SSPs with systems in systems: every number follows from SSP 1.0 by hand."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.ssp import read, tree
from tests.little_fmus import edited, edited_entries, python_fmu
from tests.orchestrator.run.test_energy import fmus
from tests.orchestrator.ssp.parameter_sets import ON, TABLE, binding, bindings, linear, values
from tests.orchestrator.ssp.ssps import HEAD, TAIL, component, connectors, line, ssp, system


def ended(path: str, folder: Path) -> dict[str, float]:
    """The outputs at the end of a run at 50 Hz."""
    experiment = simulate(path, folder / "out", ["haptics.rate=50"])
    assert experiment.outcome.fault is None
    table = experiment.results.haptics
    return {name: float(np.ravel(column)[-1]) for name, column in table.items()}


GIVER = system(
    "left",
    connectors(out="output"),
    system("inner", connectors(out="output"), component("g", "Gives"), line("out", "g.y", "2 3")),
    line("inner.out", "out", "1 100"),
)
TAKER = system(
    "right",
    connectors(u="input"),
    component("t", "Takes", ON) + component("p", "Plain"),
    line("u", "t.u", "-1 0.25") + line("p.u", "u"),
)
CHAIN = system("top", "", GIVER + TAKER, line("left.out", "right.u", "10 1"))


def test_a_chain_through_the_borders_of_systems_is_one_connection(tmp_path):
    found = ended(ssp(tmp_path, CHAIN), tmp_path)
    # 1000 mm; 2 y + 3, y + 100 in mm inside left. right.u has the unit of what it feeds: m for t,
    # none for p, so p gets mm.
    assert found["left_inner_g.y"] == 1000.0
    assert found["right_t.y"] == pytest.approx(-(10 * 2.103 + 1) + 0.25, rel=1e-14)
    assert found["right_p.y"] == pytest.approx(10 * 2103.0 + 1, rel=1e-14)


@pytest.mark.parametrize(
    ("between", "how", "expected"),
    [
        ("output cm", "", -(10 * 2.103 + 1) + 0.25),
        # The second line adds 100 to a number in mm as if that were cm.
        ("output cm", 'suppressUnitConversion="true"', -(10 * 21.03 + 1) + 0.25),
        ("output", 'suppressUnitConversion="true"', -(10 * 2.103 + 1) + 0.25),
    ],
)
def test_units_between_systems(tmp_path, between, how, expected):
    root = CHAIN.replace(connectors(out="output"), connectors(out=between), 1)
    old = line("inner.out", "out", "1 100")
    # Where left.out is in cm, 100 mm are added as 10 cm.
    added = "1 10" if between.endswith("cm") and not how else "1 100"
    path = ssp(tmp_path, root.replace(old, line("inner.out", "out", added, how)))
    assert ended(path, tmp_path)["right_t.y"] == pytest.approx(expected, rel=1e-14)


def test_a_loop_through_borders_runs_as_in_fmpy(tmp_path):
    """FMPy traces connections through borders too, for Jacobi and without transformations."""
    python_fmu(tmp_path, "Wave", "self.y = 50 * (time + size) - 5 * self.u")
    python_fmu(tmp_path, "Lag", "self.y += size * (3 * self.u - self.y)")
    made = {f"{n}_fmu": (tmp_path / f"{n}.fmu").read_bytes() for n in ("Wave", "Lag")}
    both = connectors(u="input", y="output")
    deep = system("deep", both, component("w", "Wave", both), line("u", "w.u") + line("w.y", "y"))
    left = system("left", both, deep, line("deep.y", "y") + line("u", "deep.u"))
    lags = component("a", "Lag", both) + component("b", "Lag", both)
    right = system("right", both, lags, line("u", "a.u") + line("a.y", "b.u") + line("b.y", "y"))
    root = system("top", "", left + right, line("left.y", "right.u") + line("right.y", "left.u"))
    path = ssp(tmp_path, root, **made)
    theirs = simulate_ssp(path, stop_time=0.199, step_size=0.01)
    ours = simulate(path, tmp_path / "out", ["haptics.rate=100", "coupling=jacobi"])
    for name, connector in (("left_deep_w", "left.deep.w"), ("right_b", "right.b")):
        found = ours.results.haptics[f"{name}.y"]
        assert np.abs(found).max() > 0.1
        np.testing.assert_allclose(found[1:], theirs[f"{connector}.y"], rtol=1e-12)


def test_a_vector_through_borders_stays_one(tmp_path):
    entries = {f"x[{i}]": "output m" for i in (1, 2)}
    inner = "".join(line(f"m.x[{i}]", f"x[{i}]", "3 0") for i in (1, 2))
    box = system("box", connectors(**entries), component("m", "Moves"), inner)
    across = "".join(line(f"box.x[{i}]", f"s.d[{i}]") for i in (1, 2))
    root = system("top", "", box + component("s", "Spring"), across)
    fmus(tmp_path, "mm")
    made = {f"{n}_fmu": (tmp_path / f"{n}.fmu").read_bytes() for n in ("Moves", "Spring")}
    (only,) = open_scene.load(ssp(tmp_path, root, **made), ["haptics.rate=50"]).connection
    assert (only.from_, only.to) == ("box_m.x", "s.d")
    assert (only.factor, only.offset, only.convert) == (pytest.approx(0.003, rel=1e-15), 0.0, False)


def test_names_stay_apart(tmp_path):
    inner = system("a", connectors(u="input"), component("b", "Plain"), line("u", "b.u"))
    parts = component("a_b", "Plain") + inner + component("a b", "Gives")
    root = system("top", "", parts, line("a b.y", "a.u") + line("a b.y", "a_b.u"))
    read = open_scene.load(ssp(tmp_path, root), ["haptics.rate=50", "fmu.a_b_2.rate=25"])
    assert [f.name for f in read.fmu] == ["a_b", "a_b_2", "a_b_3"]
    wired = {(c.from_, c.to) for c in read.connection}
    assert wired == {("a_b_3.y", "a_b_2.u"), ("a_b_3.y", "a_b.u")}
    assert read.fmu[1].rate == 25


def test_an_fmu_of_many_components_is_read_once(tmp_path, monkeypatch):
    """Under names that differ in signs alone: all are numbered."""
    opened: list[Path] = []

    def counted(path, **how):
        opened.append(path)
        return describe(path, **how)

    monkeypatch.setattr(read, "describe", counted)
    signs = [a + b for a in "!?.:,;-+*/()" for b in "!?.:,;-+*/()"]
    many = "".join(component(sign, "Plain") for sign in signs)
    root = system("top", "", many, line("!!.y", "!?.u"))
    tables = read.tables(Path(ssp(tmp_path, root)))
    names = [fmu["name"] for fmu in tables["fmu"]]
    assert names == ["__", *(f"___{i}" for i in range(2, len(signs) + 1))]
    assert len(opened) == 1


DESCRIPTION = "modelDescription.xml"
PACKAGE, DEFINITION = "application/x-ssp-package", "application/x-ssp-definition"


def as_component(name: str, type_: str, source: str, bound: str = "") -> str:
    return f'<ssd:Component name="{name}" type="{type_}" source="{source}">{bound}</ssd:Component>'


def inner_ssp(folder: Path, root: str, **entries: str | bytes) -> bytes:
    folder.mkdir()
    return Path(ssp(folder, root, **entries)).read_bytes()


def test_an_ssp_and_an_ssd_are_components(tmp_path):
    """Their units, FMUs and parameter files are their own; a component's bindings go before those
    of the system in it (SSP 2.0, section 5.3.3)."""
    own = bindings(binding(about='source="resources/a.ssv"'))
    strong = system(
        "any", connectors(out="output"), component("g", "Gives"), line("g.y", "out"), own
    )
    given = inner_ssp(tmp_path / "in", strong, a_ssv=values(("g.gain", "50 cm")))
    taker = system("any", connectors(u="input"), component("t", "Takes", ON), line("u", "t.u"))
    ssd = (HEAD + taker + TAIL).replace('source="resources/', 'source="')
    for bound, expected in (("", 0.5), (bindings(binding(values(("g.gain", "2")))), 2.0)):
        parts = as_component("left", PACKAGE, "resources/in.ssp", bound)
        parts += as_component("right", DEFINITION, "resources/right.ssd")
        root = system("top", "", parts, line("left.out", "right.u"))
        path = ssp(tmp_path, root, in_ssp=given, right_ssd=ssd)
        found = ended(path, tmp_path)
        assert found["left_g.y"] == 1000.0 * expected
        assert found["right_t.y"] == pytest.approx(expected, rel=1e-14)


def test_files_in_files_end(tmp_path):
    again = as_component("again", DEFINITION, "SystemStructure.ssd")
    with pytest.raises(InputFault, match="more than 32 files in files"):
        open_scene.load(ssp(tmp_path, system("top", "", again, line("again.y", "again.u"))))


def dictionary(entry: str = "way", about: str = "", inside: str | None = None) -> str:
    """A signal dictionary of one entry in cm, inline or in a file."""
    space = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
    if inside is None:
        inside = (
            f'<ssb:SignalDictionary xmlns:ssb="{space}" version="1.0" '
            'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">'
            f'<ssb:DictionaryEntry name="{entry}"><ssc:Real unit="cm"/></ssb:DictionaryEntry>'
            '<ssb:Units><ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit>'
            "</ssb:Units></ssb:SignalDictionary>"
        )
    defined = f'<ssd:SignalDictionary name="d" {about}>{inside}</ssd:SignalDictionary>'
    return f"<ssd:SignalDictionaries>{defined}</ssd:SignalDictionaries>"


def reference(name: str, kind: str, dictionary: str = "d") -> str:
    what = f'name="{name}" dictionary="{dictionary}"'
    ports = connectors(way=kind)
    return f"<ssd:SignalDictionaryReference {what}>{ports}</ssd:SignalDictionaryReference>"


def through_dictionary(defined: str, *more: str) -> str:
    """A giver in a system in a system, whose output two takers elsewhere read from a dictionary."""
    giver = component("g", "Gives") + reference("bus", "input")
    deep = system("deep", "", giver, line("g.y", "bus.way"))
    both = component("t", "Takes", ON) + component("p", "Plain") + reference("bus", "output")
    right = system("right", "", both, line("bus.way", "t.u") + line("p.u", "bus.way"))
    inside = system("left", "", deep, "") + right + "".join(more)
    end = "</ssd:System>"
    text = system("top", "", inside, "").removesuffix(end) + defined + end
    return text.replace("<ssd:Connections></ssd:Connections>", "")


@pytest.mark.parametrize("in_file", [False, True])
def test_an_entry_of_a_signal_dictionary_connects_across_systems(tmp_path, in_file):
    """In the unit of the entry: 1000 mm are 100 cm, which are 1 m for t; p has no unit."""
    inline = dictionary()
    content = inline.partition(">")[2].partition(">")[2].rpartition("</ssd:SignalDictionary>")[0]
    files = {"d_ssb": content} if in_file else {}
    defined = dictionary(about='source="resources/d.ssb"', inside="") if in_file else inline
    found = ended(ssp(tmp_path, through_dictionary(defined), **files), tmp_path)
    assert found["left_deep_g.y"] == 1000.0
    assert found["right_t.y"] == pytest.approx(1.0, rel=1e-14)
    assert found["right_p.y"] == pytest.approx(100.0, rel=1e-14)


@pytest.mark.parametrize(
    ("defined", "more", "message"),
    [
        ("", "", r"left\.deep\.bus: no signal dictionary 'd'; none"),
        (dictionary("other"), "", r"left\.deep\.bus\.way is no entry of 'd'; entries: other"),
        (dictionary(inside=""), "", "d: a SignalDictionary has neither source nor content"),
        (dictionary(), reference("bus", "input"), r"right\.bus\.way is fed by .* and by"),
    ],
)
def test_a_dictionary_that_does_not_fit_is_refused(tmp_path, defined, more, message):
    path = ssp(tmp_path, through_dictionary(defined, more))
    with pytest.raises(InputFault, match=message):
        open_scene.load(path, ["haptics.rate=50"])


OTHERS = component("p", "Plain") + component("t", "Text")
TEXT = system("top", "", OTHERS, line("p.y", "t.on"))
LOOP = system("loop", connectors(a="input", b="output"), component("p", "Plain"), line("a", "b"))
CIRCLE = system(
    "top", "", LOOP + component("q", "Plain"), line("loop.b", "loop.a") + line("q.u", "loop.b")
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name="inner"', 'name="outer"', r"names left\.inner\.out, which does not exist"),
        (line("p.u", "u"), line("p.y", "u"), r"right\.u are connected, and both are outputs"),
        (line("p.u", "u"), line("u", "t.u"), r"right\.t\.u is fed by right\.u and by right\.u"),
        ('name="p" source', 'name="t" source', r"right has two elements named 't'"),
        (linear(-1, 0.25), TABLE, "BooleanMappingTransformation is read in parameter"),
        ('source="resources/Plain', 'implementation="ModelExchange" source="resources/Plain',
         r"it is for co-simulation only, not for model-exchange"),
        ('source="resources/Plain', 'implementation="ScheduledExecution" source="resources/Plain',
         r"right\.p is a Component for ScheduledExecution"),
        ('kind="input"', 'kind="inout"', r"right\.u is inout"),
        (connectors(u="input"), connectors(u="input N"),
         r"units of left\.out and right\.u do not fit: m is not"),
        (CHAIN, TEXT, "on is a String: a String output is connected to a String input only"),
        (CHAIN, CIRCLE, r"in a circle without an FMU: loop\.b -> loop\.a"),
    ],
)  # fmt: skip
def test_what_cannot_be_wired_is_refused(tmp_path, old, new, message):
    assert old in CHAIN + TAIL
    edited(python_fmu(tmp_path, "Text"), lambda text: text.replace("<Boolean", "<String"))
    text = (tmp_path / "Text.fmu").read_bytes()
    path = ssp(tmp_path, CHAIN.replace(old, new), TAIL.replace(old, new), Text_fmu=text)
    with pytest.raises(InputFault, match=message):
        simulate(path, tmp_path / "out", ["haptics.rate=50"])


def test_files_that_name_each_other_twice_end(tmp_path):
    """They double with each of 32 levels that are allowed."""
    both = connectors(u="input", y="output")
    deep = {"20_ssd": HEAD + system("any", both, component("p", "Plain"), line("u", "y")) + TAIL}
    for i in range(20):
        twice = "".join(as_component(n, DEFINITION, f"{i + 1}.ssd") for n in "ab")
        deep[f"{i}_ssd"] = HEAD + system("any", both, twice, line("a.y", "b.u")) + TAIL
    root = system("top", both, as_component("c", DEFINITION, "resources/0.ssd"), line("u", "c.u"))
    with pytest.raises(InputFault, match="more than 1000 files in files, counted as often"):
        open_scene.load(ssp(tmp_path, root, **deep))


def test_parts_and_bytes_are_those_of_the_whole_document(tmp_path, monkeypatch):
    inside = system("any", connectors(out="output"), component("g", "Gives"), line("g.y", "out"))
    given = inner_ssp(tmp_path / "in", inside)
    many = "".join(as_component(f"c{i}", PACKAGE, "resources/in.ssp") for i in range(9))
    path = Path(ssp(tmp_path, system("top", "", many, line("c1.out", "c2.out")), in_ssp=given))
    for bound, most in (
        ("MOST_FILES", 8),
        ("MOST_PARTS", 25),
        ("MAX_XML_BYTES", 9 * len(inside)),
        ("MAX_BYTES", 9 * len(given)),
    ):
        with monkeypatch.context() as lower:
            lower.setattr(tree, bound, most)
            with pytest.raises(InputFault, match=f"more than {most} "):
                read.tables(path)


def test_a_unit_of_nothing_is_refused(tmp_path):
    tail = TAIL.replace('factor="0.001"', 'factor="0"')
    path = ssp(tmp_path, system("top", "", component("g", "Gives"), line("g.y", "g.u")), tail)
    with pytest.raises(InputFault, match=r"their\.ssp: unit 'mm' has factor 0 and offset 0"):
        read.tables(Path(path))


def test_a_refused_fmu_does_not_stay_in_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "cache"))
    path = Path(ssp(tmp_path, system("top", "", component("g", "none"), line("g.y", "g.u"))))
    damaged = edited_entries(tmp_path / "Gives.fmu", lambda all_: all_ | {DESCRIPTION: b"<a/>"})
    with zipfile.ZipFile(path, "a") as archive:
        archive.write(damaged, "resources/none.fmu")
    with pytest.raises(InputFault, match=r"their\.ssp: g: resources/none\.fmu: "):
        read.tables(path)
    assert not [*(tmp_path / "cache").rglob("*.fmu")]
