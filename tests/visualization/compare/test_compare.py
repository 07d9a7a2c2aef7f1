"""Runs beside each other, and the page of a run."""

import base64
import filecmp
import json
import re
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.results.folders import load_by_name
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import scene_file
from hapticlink.visualization.compare import numbers, overlay, page, settings
from tests.shared_fixtures import status


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("runs")
    hl.run(
        "closed-loop-ideal",
        {"graphics.rate": 10, "duration": 1.0},
        out=found / "slow",
        figures=False,
    )
    hl.run("closed-loop-ideal", {"duration": 0.7}, out=found / "fast", figures=False)
    hl.run("parallelogram", {"duration": 0.3}, out=found / "other", figures=False)
    return found


def with_keys(root: Path, name: str, **keys: object) -> Results:
    """A recorded run of which keys of run.json are others."""
    run = hl.load(root / name)
    return replace(run, run=run.run | keys)


def titled(root: Path, name: str, title: str) -> Results:
    """A recorded run of a scene with another title."""
    return with_keys(root, name, scene=hl.load(root / name).run["scene"] | {"title": title})


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of a page's text: figures take most of its time."""
    monkeypatch.setattr(page.of_a_run, "drawings", lambda run: {})


def test_settings_that_differ_are_all_of_them(root: Path) -> None:
    found = settings.differing([hl.load(root / name) for name in ("slow", "fast")])
    assert found == {"duration": ("1.0", "0.7"), "graphics.rate": ("10", "30")}


def test_settings_of_a_block_that_was_replaced_are_not_listed(root: Path) -> None:
    """Nor in the run that has the block: the other has nothing to compare them with."""
    own = hl.load(root / "fast").run["scene"]
    other = own | {"controller": own["controller"] | {"impedance": False}}
    runs = [hl.load(root / "fast"), with_keys(root, "fast", scene=other)]
    assert list(settings.differing(runs)) == ["controller.impedance"]
    swapped = {"controller": {"lost": [], "unfed": [], "mapped": {}}}
    runs[1] = with_keys(root, "fast", scene=other, replaced=swapped)
    assert settings.differing(runs) == {}


def test_errors_are_compared_until_the_first_end(root: Path) -> None:
    runs = [hl.load(root / name) for name in ("slow", "fast")]
    rows = {r.label: r.values for r in numbers.sections(runs)["Performance, all until 0.699 s"]}
    for run, said in zip(runs, rows["tracking error, largest (mm)"], strict=True):
        away = run["virtual_mechanism.x"] - run["haptic_device.x_true"]
        most = np.hypot(*away[run.time("haptic_device.x_true") < 0.7].T[:2]).max()
        assert float(said) == pytest.approx(1e3 * most, rel=2e-3)
    x, other = (run["virtual_mechanism.x"][:359, :2] for run in runs)
    said = rows["operational point from that of the first run, largest (mm)"][1]
    assert float(said) == pytest.approx(1e3 * np.hypot(*(x - other).T).max(), rel=2e-3)


def test_other_scenes_are_told(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert status("compare", str(root / "slow"), str(root / "other")) == 0
    said = capsys.readouterr().out
    assert "warning: different mechanisms: Five-bar in the hand, idealised; " in said
    assert "operational point from that of the first run" not in said


def test_a_run_of_an_earlier_format_is_told(root: Path, tmp_path: Path) -> None:
    """Its `closed-loop` was ideally sensed."""
    shutil.copytree(root / "slow", tmp_path / "old")
    told = json.loads((tmp_path / "old" / "run.json").read_text())
    del told["scene"]["format"], told["scene"]["experiment"]
    (tmp_path / "old" / "run.json").write_text(json.dumps(told))
    said = "different formats of scenes: `closed-loop` of a scene without a format is"
    assert said in str(hl.compare([str(root / "slow"), str(tmp_path / "old")]))
    assert said not in str(hl.compare([str(root / "slow"), str(root / "other")]))


def test_runs_that_failed_are_said_first() -> None:
    """A spring of 1e7 N/m on 1 kg, sampled at 20 Hz, throws it off."""
    springs = ([1e7, 0.0, 0.0], [2e7, 0.0, 0.0], [10.0, 0.0, 0.0])
    runs = {
        f"spring {i}": hl.run("sampled-spring", {"hand.stiffness": spring})
        for i, spring in enumerate(springs)
    }
    first = str(hl.compare(runs)).partition("\n")[0]
    assert first.startswith("2 of 3 runs failed: spring 0 diverged at ")
    assert "spring 2" not in first


def test_runs_that_are_equal_in_every_row_are_said_to_be(root: Path, tmp_path: Path) -> None:
    said = "the runs recorded the same numbers in every row"
    again, other = tmp_path / "again", tmp_path / "other"
    for copy in (again, other):
        shutil.copytree(root / "slow", copy)
    table = other / "haptics.csv"
    *rows, last = table.read_text().splitlines()
    table.write_text("\n".join([*rows, last.replace("1", "2", 1)]) + "\n")
    assert str(hl.compare([root / "slow", again])).startswith(said)
    assert said not in str(hl.compare([root / "slow", other]))


def test_the_command_draws_and_prints_json(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = str(root / "slow"), str(root / "fast")
    assert status("compare", *folders, "--out", str(tmp_path), "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert [*told["runs"]] == ["slow", "fast"]
    assert told["runs"]["slow"]["Settings that differ"]["graphics.rate"] == "10"
    assert {"distance.png", "forces.png", "paths.png"} <= {p.name for p in tmp_path.iterdir()}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("compare", "slow"), "two runs or more"),
        (("compare", "slow", "slow"), "slow: is named twice"),
        (("report", "nowhere"), "nowhere: not the folder of a run"),
        (("report", "slow", "--out", "."), "--out .: is a folder; name a file"),
    ],
)
def test_bad_input(
    root: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    given: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(root)
    assert status(*given) == 2
    assert said in capsys.readouterr().err


def test_the_page_answers_in_the_order_in_which_one_asks(root: Path) -> None:
    runs = load_by_name([root / "slow", root / "fast"])
    html = page.page(runs)
    assert html == page.page(runs)
    assert re.findall("<h2>(.*?)</h2>", html) == [
        "What ran", "Outcome", "Performance, all until 0.699 s", "Energies, of the whole run",
        "Stability and steps", "Timing", "Settings that differ", "How to make it again",
    ]  # fmt: skip
    pictures = re.findall('src="data:image/png;base64,(.*?)"', html)
    assert len(pictures) == 7
    assert all(base64.b64decode(picture).startswith(b"\x89PNG") for picture in pictures)
    assert not {"script", "link", "iframe"} & {*re.findall(r"<(\w+)", html)}
    assert not re.search(r"(src|href)=\"(?!data:)", html)


@pytest.mark.usefixtures("without_figures")
def test_text_of_a_scene_is_text_in_the_page(root: Path) -> None:
    title = "<script>alert(1)</script> & more"
    html = page.page({"run": titled(root, "other", title)})
    assert "<script" not in html
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; more" in html


def test_dollar_signs_of_a_scene_are_no_formula(root: Path) -> None:
    """Matplotlib fails at what two of them enclose if that is no formula, as here."""
    title = r"costs $1 \\g $& more $$ or _less"
    runs = {"$a$_{": titled(root, "fast", title), "_b": hl.load(root / "slow")}
    page.page({"$a$_{": runs["$a$_{"]})  # with all figures of a run
    page.page(runs)
    legend = overlay.figures(runs)["distance"].axes[0].get_legend()
    assert legend
    assert [text.get_text() for text in legend.get_texts()] == [r"\$a\$_{", "_b"]


@pytest.mark.filterwarnings("error")
def test_letters_that_no_font_has_are_replaced(root: Path) -> None:
    run = titled(root, "fast", "闭环 Механизм")
    assert "闭环" in page.page({"环": run})
    legend = overlay.figures({"环 Механизм": run, "b": run})["distance"].axes[0].get_legend()
    assert legend
    assert legend.get_texts()[0].get_text() == "\N{REPLACEMENT CHARACTER} Механизм"


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("scene", "title"), 3),
        (("connections", 0), None),
        (("end", "reason"), None),
        (("clocks", "haptics"), {}),
        (("delays", "hand.F -> controller.F_hand"), {}),
        (("step_errors", "haptic_device"), {"sum": "much"}),
        (("fault",), "broken"),
    ],
)
def test_a_run_json_that_was_changed_is_bad_input(
    root: Path, tmp_path: Path, keys: tuple[str | int, ...], value: object
) -> None:
    run = json.loads((root / "fast" / "run.json").read_text())
    place = run
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    (tmp_path / "run.json").write_text(json.dumps(run))
    with pytest.raises(hl.InputFault, match=r"run\.json: .*: run the scene again"):
        load_by_name([tmp_path])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "\n0.001953125,",
            "\n0.001953125,7,",
            "haptics.csv: line 3 has 64 values, not 63: run the",
        ),
        ("\n0.001953125,", "\nabc,", "haptics.csv: line 3: time = 'abc' is no number: run the"),
        ("\n0.00390625,", "\n0.001,", "line 4: time = 0.001 s is before that of the line above"),
        ("time,", "t,", "haptics.csv: line 1: its first column is 't', not 'time'"),
    ],
)
def test_a_table_that_was_changed_is_bad_input(
    root: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    table = Path(shutil.copytree(root / "fast", tmp_path / "run")) / "haptics.csv"
    table.write_text(table.read_text().replace(old, new, 1))
    with pytest.raises(hl.InputFault, match=re.escape(said)):
        load_by_name([tmp_path / "run"])


@pytest.mark.filterwarnings("error")
def test_a_run_without_a_finite_value_has_a_page(root: Path, tmp_path: Path) -> None:
    run = shutil.copytree(root / "fast", tmp_path / "run")
    lines = (run / "haptics.csv").read_text().splitlines()
    lines[1:] = [f"{line.partition(',')[0]}{',nan' * line.count(',')}" for line in lines[1:]]
    (run / "haptics.csv").write_text("\n".join(lines) + "\n")
    assert 'alt="mechanism"' not in page.page(load_by_name([run]))


@pytest.mark.usefixtures("without_figures")
def test_warnings_alone_are_red(root: Path) -> None:
    lines = ["one: 7 steps were repeated"]
    assert 'class="bad"' not in page.page({"fast": with_keys(root, "fast", warnings=lines)})
    lines = [*lines, "warning: a contact is too stiff"]
    html = page.page({"fast": with_keys(root, "fast", warnings=lines)})
    assert '<td class="bad">a contact is too stiff</td>' in html


def test_a_table_without_rows_beside_one_with_rows(root: Path, tmp_path: Path) -> None:
    """As a process that is killed can leave them."""
    folder = shutil.copytree(root / "fast", tmp_path / "run")
    table = folder / "haptics.csv"
    table.write_text(table.read_text().partition("\n")[0] + "\n")
    assert "Performance" in page.page(load_by_name([folder]))


def test_a_run_without_a_linkage_and_one_that_failed_have_a_page(tmp_path: Path) -> None:
    hl.run("virtual-wall", {"duration": 0.1}, out=tmp_path / "wall", figures=False)
    push = {"hand.wrench": [1e6, 0.0, 0.0], "stop_when": ""}
    failed = hl.run("closed-loop-ideal", push, out=tmp_path / "failed", figures=False)
    html = page.page(load_by_name([tmp_path / "wall", tmp_path / "failed"]))
    assert failed.fault
    assert f'<td class="bad">{failed.fault.splitlines()[0]}' in html


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("closed-loop-ideal", {"sensing": "encoders"}),
        ("virtual-wall", {}),
        ("two-hands", {}),
        ("two-users", {"sensing": "encoders"}),
        ("push-disc", {}),
    ],
)
def test_the_scene_of_a_page_gives_the_same_tables(
    tmp_path: Path, name: str, options: dict[str, str]
) -> None:
    first = hl.run(name, {"duration": 0.2} | options, out=tmp_path / "first", figures=False)
    text = scene_file(first)
    assert tomllib.loads(text)["title"] == first.run["scene"]["title"]
    (tmp_path / "scene.toml").write_text(text)
    hl.run(tmp_path / "scene.toml", out=tmp_path / "again", figures=False)
    tables = [n for n in first.run["files"] if n.endswith(".csv")]
    same, *_ = filecmp.cmpfiles(tmp_path / "first", tmp_path / "again", tables, shallow=False)
    assert sorted(same) == sorted(tables)
