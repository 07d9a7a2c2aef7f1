"""Modules of a user's own: how they are found, what goes wrong, what depends on their sources."""

import json
from pathlib import Path

import pytest

from tests.plugins import hapticlink

HOLD = """
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.zero_order import ZeroOrder

HOLDS.register({name!r}, ZeroOrder)
"""
PUSH = """
from dataclasses import dataclass
import casadi as ca
from hapticlink.components.forces import FORCES, Force

@dataclass(frozen=True, kw_only=True)
class Push(Force):
    body: str = "cart"
    def efforts(self, model):
        return ca.jacobian(model.frames[self.body].origin, model.q).T @ ca.DM([1.0, 0.0])

FORCES.register("push", Push)
"""
SCENE = """
title = "A cart that is pushed"
duration = 1.0
haptics.rate = 100
[linkage]
operational_point.body = "cart"
[[linkage.body]]
name = "cart"
mass = 1.0
inertia = 0.1
[[linkage.joint]]
name = "rail"
type = "prismatic"
child = "cart"
axis = 0.0
[[linkage.force]]
type = "push"
name = "push"
"""
EXPLAIN = "hapticlink run sampled-spring --explain"


def write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)


def test_modules_that_are_no_plugins(tmp_path: Path) -> None:
    write(tmp_path, mine=HOLD.format(name="mine"), lacks="import not_there", empty="x = 1")
    write(tmp_path, broken="\n\n1 / 0\n", taken=HOLD.format(name="foh"), misspelt="x = 1\nx = = 2")
    messages = {
        "nowhere": "--plugin nowhere: no such module, nor a file in",
        "mine.py": "give its name, without .py",
        "lacks": "--plugin lacks: it imports 'not_there', which is not there",
        "broken": "broken.py, line 3: ZeroDivisionError: division by zero",
        "misspelt": "misspelt.py, line 2: SyntaxError: invalid syntax",
        "empty": "empty.py registers no part (docs/extending.md)",
        "taken": "taken.py, line 5: ValueError: hold 'foh' is one of hapticlink: take another",
    }
    for ended, message in zip(
        hapticlink(tmp_path, *(f"{EXPLAIN} --plugin {module}" for module in messages)),
        messages.values(),
        strict=True,
    ):
        assert ended.status == 2
        assert message in ended.said
        assert len(ended.said.splitlines()) == 1


def test_a_part_is_known_where_its_plugin_is_named(tmp_path: Path) -> None:
    write(tmp_path, mine=HOLD.format(name="mine"), yours=HOLD.format(name="yours"))
    line = f"{EXPLAIN} --set hold=mine --set downsampling=latest"
    without, before, after, other = hapticlink(
        tmp_path, line, f"hapticlink --plugin mine {line[11:]}",
        f"{line} --plugin=yours --plugin mine", f"{line} --plugin yours",
    )  # fmt: skip
    assert (without.status, before.status, after.status, other.status) == (2, 0, 0, 2)
    assert "--set hold=mine: hold: no hold 'mine'" in without.said
    assert "yours, or those of a plugin" in other.said
    assert "yours" not in without.said


def test_an_installed_plugin(tmp_path: Path) -> None:
    """By the entry points of a distribution; its commands too."""
    site, folder = tmp_path / "site", tmp_path / "here"
    about = site / "my_parts-1.2.dist-info"
    about.mkdir(parents=True)
    folder.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-parts\nVersion: 1.2\n")
    (about / "entry_points.txt").write_text("[hapticlink.plugins]\nparts = my_parts.holds\n")
    (site / "my_parts").mkdir()
    (site / "my_parts" / "holds.py").write_text(
        HOLD.format(name="mine")
        + """
from hapticlink.orchestrator.commands import COMMANDS

def greet() -> int:
    print("good day")
    return 3

COMMANDS.register("greet", greet)
"""
    )
    run, greeted = hapticlink(
        folder, "hapticlink run sampled-spring --set hold=mine", "hapticlink greet", path=site
    )
    assert (run.status, run.said and greeted.status, greeted.said) == (0, 3, "good day\n")
    told = json.loads((folder / "runs" / "sampled-spring" / "run.json").read_text())["plugins"]
    assert told["my_parts.holds"]["version"] == "1.2"
    (site / "my_parts" / "holds.py").write_text("1 / 0")
    (ended,) = hapticlink(folder, "hapticlink run sampled-spring", path=site)
    assert "hapticlink: plugin parts of my-parts: " in ended.said


def test_an_edited_plugin_makes_other_fmus_and_runs(tmp_path: Path) -> None:
    """x = t^2/2 of 1 kg pushed with 1 N; a sweep runs again, a hold alone leaves the FMU."""
    (tmp_path / "scene.toml").write_text(SCENE)
    write(tmp_path, push=PUSH, mine=HOLD.format(name="mine"))
    sweep = "hapticlink sweep scene.toml --plugin push --vary duration=0.5,1"
    run = "hapticlink run scene.toml --plugin push"
    cache = tmp_path / "cache"

    def reached(line: str) -> float:
        (ended,) = hapticlink(tmp_path, line, cache=cache)
        assert ended.status == 0, ended.said
        last = (tmp_path / "runs" / "scene" / "haptics.csv").read_text().splitlines()
        return float(last[-1].split(",")[last[0].split(",").index("virtual_mechanism.x[1]")])

    def rows() -> int:
        hapticlink(tmp_path, sweep, cache=cache)
        return len([*(tmp_path / "sweeps" / "scene" / "rows").iterdir()])

    assert reached(run) == pytest.approx(0.5, rel=1e-12)
    assert reached(f"{run} --plugin mine") == pytest.approx(0.5, rel=1e-12)
    assert len([*cache.iterdir()]) == 1
    assert (rows(), rows()) == (2, 2)
    write(tmp_path, push=PUSH.replace("[1.0, 0.0]", "[-2.0, 0.0]"))
    assert reached(run) == pytest.approx(-1.0, rel=1e-12)
    assert rows() == 4


def test_keys_of_a_force(tmp_path: Path) -> None:
    write(tmp_path, push=PUSH)
    entry = '[[linkage.force]]\ntype = "push"\nname = "push"\n'
    assert SCENE.endswith(entry)  # its lines are 16 to 18
    messages = {
        entry.replace('"push"\nn', '"psh"\nn'): "line 17: linkage.force[0] (push).type: no force",
        entry.replace('type = "push"\n', ""): "linkage.force[0] (push).type: is missing",
        entry.replace('name = "push"\n', ""): "line 16: linkage.force[0].name: is missing",
        entry + "bdy = 1": "line 19: linkage.force[0] (push).bdy: unknown key; did you mean 'body'",
        entry + "body = 3": "line 19: linkage.force[0] (push).body: 3 should be a valid string",
        entry + 'body = "crt"': "force `push`: the linkage has no 'crt'",
        entry + entry: "line 21: linkage.force[1] (push).name: 'push' is taken",
    }
    for i, text in enumerate(messages):
        (tmp_path / f"{i}.toml").write_text(SCENE.removesuffix(entry) + text)
    lines = (f"hapticlink run {i}.toml --plugin push" for i in range(len(messages)))
    for ended, message in zip(hapticlink(tmp_path, *lines), messages.values(), strict=True):
        assert ended.status == 2
        assert message in ended.said
