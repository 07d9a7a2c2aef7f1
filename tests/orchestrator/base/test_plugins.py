"""Modules of a user's own: how they are found, what goes wrong, what depends on their sources."""

import json
import re
from pathlib import Path

import pytest

from hapticlink.orchestrator.base import plugins
from hapticlink.orchestrator.base.errors import InputFault
from tests.plugins import hapticlink

HOLD = """
from hapticlink.orchestrator.holds import HOLDS, Hold

class Newest(Hold):
    def __init__(self, context): pass
    def push(self, described, sample, arrival): self.sample = sample.copy()
    def value(self, tick, ahead=0.0): return self.sample

HOLDS.register({name!r}, Newest)
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
GREET = """
from hapticlink.commands import COMMANDS

def greet() -> int:
    print("good day")
    return 3

COMMANDS.register("greet", greet)
"""
EXPLAIN = "hapticlink run sampled-spring --explain"


def write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)


def said(folder: Path, status: int, *cases: tuple[str, str, str, str]) -> None:
    """Each case: a plugin and its text, a command that takes it, and what that says as it ends
    with `status`; FOLDER is that of the plugins."""
    write(folder, **{name: text for name, text, _, _ in cases})
    lines = (f"{command} --plugin {name}" for name, _, command, _ in cases)
    for ended, (*_, message) in zip(hapticlink(folder, *lines), cases, strict=True):
        assert ended.status == status, ended.said
        assert message.replace("FOLDER", str(folder)) in ended.said
        assert "error of hapticlink itself" not in ended.said
        first, *findings = ended.said.splitlines()
        assert status == 1 or all(line.startswith("  ") for line in findings), first


def test_modules_that_are_no_plugins(tmp_path):
    texts = {
        "lacks": ("import not_there", "--plugin lacks: it imports 'not_there', which is not there"),
        "broken": ("\n\n1 / 0\n", "broken.py, line 3: ZeroDivisionError: division by zero"),
        "misspelt": ("x = 1\nx = = 2", "misspelt.py, line 2: SyntaxError: invalid syntax"),
        "ends": ("import sys\nsys.exit('usage')", "ends.py, line 2: SystemExit: usage"),
        "empty": ("x = 1", "empty.py registers no part (docs/extending.md)"),
        "taken": (
            HOLD.format(name="foh"),
            "taken.py, line 9: ValueError: hold 'foh' is one of hapticlink: take another",
        ),
        "named": (HOLD.format(name="my hold"), "hold 'my hold': name it by letters, digits, _ and"),
    }
    said(tmp_path, 2, *((name, text, EXPLAIN, message) for name, (text, message) in texts.items()))
    write(tmp_path, mine=HOLD.format(name="mine"))
    for name, message in (("nowhere", "no such module, nor a file in"), ("mine.py", "without .py")):
        (ended,) = hapticlink(tmp_path, f"{EXPLAIN} --plugin {name}")
        assert (ended.status, ended.said.count("\n")) == (2, 1)
        assert message in ended.said


HOLDING = """
import numpy as np
from hapticlink.orchestrator.holds import HOLDS, Hold

class Mine(Hold):
    def __init__(self, context):
        self.size, self.pushed = context.size, 0
    def push(self, described, sample, arrival):
        self.pushed += 1
    def value(self, tick, ahead=0.0):
        {value}

HOLDS.register("mine", Mine)
"""
VAGUE = "from hapticlink.orchestrator.holds import Hold\nclass Mine(Hold): needs = 'speed'"
SPEED = """from hapticlink.orchestrator.holds import Hold
class Mine(Hold):
    needs = 'speed'
    def __init__(self, context): pass
    def push(self, described, sample, arrival): pass
    def value(self, tick, ahead=0.0): pass"""
INTEGRATOR = """from hapticlink.components.integrators.base import Integrator
class Mine(Integrator):
    order = 1
    def step(self, ode, x, u, p, t, h): return {}"""
SCHEME = "from hapticlink.orchestrator.plan.schemes import Scheme"
RAISING = "def mine(n: int = 0): raise RuntimeError('no')"
REGISTRIES = {
    "HOLDS": "orchestrator.holds", "METHODS": "components.integrators", "COMMANDS": "commands",
    "BLOCKS": "components.blocks", "FAMILIES": "orchestrator.scene.families",
    "SCHEMES": "orchestrator.plan.schemes", "FORCES": "components.forces",
}  # fmt: skip
INTEGRATED = "hapticlink run pendulum --set mechanism.integrator=mine"
COUPLED = "hapticlink run sampled-spring --set coupling=mine"
BLOCK, FAMILY = "hapticlink run block.toml", "hapticlink run family.toml"
PARTS = [
    # Of another kind than the registry's, refused where they are registered.
    ("HOLDS", "", "3", EXPLAIN, "hold 'mine': 3 is no class derived from Hold"),
    ("HOLDS", VAGUE, "Mine", EXPLAIN, "does not define __init__, push, value"),
    ("HOLDS", SPEED, "Mine", EXPLAIN, "needs 'speed', which is none of (None, 'derivative',"),
    ("METHODS", "", "7", EXPLAIN, "integrator 'mine': 7 is no Integrator"),
    ("FORCES", "", "dict", EXPLAIN, "force 'mine': <class 'dict'> is no class derived from Force"),
    ("BLOCKS", "", "3", EXPLAIN, "block 'mine': 3 is no function"),
    ("BLOCKS", "", "lambda x: 0", EXPLAIN, "an argument x: a setting has a name and an annot"),
    ("FAMILIES", "", "{}", EXPLAIN, "family 'mine': {} is no function"),
    ("SCHEMES", "", "print", EXPLAIN, "scheme 'mine': <built-in function print> is no Scheme"),
    ("COMMANDS", "", "'Help'", EXPLAIN, "command 'mine': 'Help' is no function"),
    # Failing, or giving something else, where they are used.
    ("METHODS", INTEGRATOR.format("x[:1]"), "Mine()", INTEGRATED,
     "virtual_mechanism: integrator Mine: its step gives (1, 1), not (3, 1)"),
    ("METHODS", INTEGRATOR.format("[][1]"), "Mine()", INTEGRATED,
     "plugin part11: FOLDER/part11.py, line 5: IndexError"),
    ("SCHEMES", SCHEME, "Scheme(lambda *_: None)", COUPLED, "'mine': None is no tuple of operat"),
    ("SCHEMES", SCHEME, "Scheme(lambda *_: ())", COUPLED, "coupling = 'mine' leaves out "),
    ("BLOCKS", "", "lambda: 7", BLOCK, "mine: the block gives 7"),
    ("BLOCKS", "def mine(n: 'Never' = 0): return 7", "mine", BLOCK,
     "part15: the annotations of Settings cannot be read"),
    ("FAMILIES", "", "lambda n: None", FAMILY,
     "line 3: linkage.family: mine gives None for n = 4, no tables"),
    ("FAMILIES", RAISING, "mine", FAMILY, "plugin part17: FOLDER/part17.py, line 2: RuntimeError"),
    ("COMMANDS", RAISING, "mine", "hapticlink mine",
     "plugin part18: FOLDER/part18.py, line 2: RuntimeError: no"),
    # Of an earlier version.
    ("HOLDS", SPEED.replace("speed", "spring"), "Mine", EXPLAIN, "take hold = \"pspm\""),
    ("HOLDS", "from hapticlink.orchestrator.holds import OfSamples", "OfSamples", EXPLAIN,
     "; docs/extending.md has a complete example of each part"),
]  # fmt: skip


def test_parts_of_another_kind_and_parts_that_fail(tmp_path):
    head = 'title = "a"\nduration = 1.0\n'
    (tmp_path / "block.toml").write_text(f'{head}[[fmu]]\nname = "a"\nblock = "mine"\n')
    (tmp_path / "family.toml").write_text(f'{head}linkage = {{ family = "mine", n = 4 }}\n')
    cases = []
    for i, (registry, text, part, command, message) in enumerate(PARTS):
        head = f"from hapticlink.{REGISTRIES[registry]} import {registry}\n{text}\n"
        plugin = f"{head}{registry}.register('mine', {part})\n"
        cases.append((f"part{i}", plugin, command, message))
    said(tmp_path, 2, *cases)


def test_a_hold_that_fails_ends_the_run_with_its_results(tmp_path):
    late = "if self.pushed > 3: 1 / 0\n        return np.ones(self.size)"
    values = {
        late: "plugin mine0: FOLDER/mine0.py, line 11: ZeroDivisionError: division by zero",
        "return None": "its value is None, where 9 finite numbers in a NumPy array are needed",
        "return np.ones(2)": "its value is array([1., 1.]), where 9 finite numbers",
        "return np.full(self.size, np.nan)": "its value is array([nan, nan, nan,",
        "return np.array(['1'] * 9)": "its value is array(['1', '1',",
    }
    run = "hapticlink run closed-loop-ideal --set graphics.rate=100 --set duration=0.1 --no-figures"
    said(tmp_path, 1, *(
        (f"mine{i}", HOLDING.format(value=value), f"{run} --set hold=mine --out {i}", message)
        for i, (value, message) in enumerate(values.items())
    ))  # fmt: skip
    told = json.loads((tmp_path / "0" / "run.json").read_text())
    assert (told["end"]["reason"], told["fault"]["kind"]) == ("fault", "Fault")
    assert len((tmp_path / "0" / "haptics.csv").read_text().splitlines()) > 3


def test_a_part_is_known_where_its_plugin_is_named(tmp_path):
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


def test_an_installed_plugin(tmp_path):
    """By the entry points of a distribution; its commands too."""
    site, folder = tmp_path / "site", tmp_path / "here"
    about = site / "my_parts-1.2.dist-info"
    about.mkdir(parents=True)
    folder.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-parts\nVersion: 1.2\n")
    (about / "entry_points.txt").write_text("[hapticlink.plugins]\nparts = my_parts.holds\n")
    (site / "my_parts").mkdir()
    (site / "my_parts" / "holds.py").write_text(HOLD.format(name="mine") + GREET)
    run, greeted = hapticlink(
        folder, "hapticlink run sampled-spring --set hold=mine", "hapticlink greet", path=site
    )
    assert (run.status, run.said and greeted.status, greeted.said) == (0, 3, "good day\n")
    told = json.loads((folder / "runs" / "sampled-spring,hold=mine" / "run.json").read_text())
    assert told["plugins"]["my_parts.holds"]["version"] == "1.2"
    (site / "my_parts" / "holds.py").write_text("1 / 0")
    (ended,) = hapticlink(folder, "hapticlink run sampled-spring", path=site)
    assert "hapticlink: plugin parts of my-parts: " in ended.said


def test_an_edited_plugin_makes_other_fmus_and_runs(tmp_path):
    """x = t^2/2 of 1 kg pushed with 1 N; a sweep runs again, a hold alone leaves the FMU."""
    (tmp_path / "scene.toml").write_text(SCENE)
    write(tmp_path, push=PUSH, mine=HOLD.format(name="mine"))
    sweep = "hapticlink sweep scene.toml --plugin push --vary duration=0.5,1 --jobs 1"
    run = "hapticlink run scene.toml --plugin push --no-figures"
    cache = tmp_path / "cache"

    def reached(line):
        (ended,) = hapticlink(tmp_path, line, cache=cache)
        assert ended.status == 0, ended.said
        last = (tmp_path / "runs" / "scene" / "haptics.csv").read_text().splitlines()
        return float(last[-1].split(",")[last[0].split(",").index("virtual_mechanism.x[1]")])

    def rows():
        hapticlink(tmp_path, sweep, cache=cache)
        return len([*(tmp_path / "sweeps" / "scene" / "rows").iterdir()])

    assert reached(run) == pytest.approx(0.5, rel=1e-12)
    assert reached(f"{run} --plugin mine") == pytest.approx(0.5, rel=1e-12)
    others = {"libraries", "locks", *(path.name for path in cache.glob("loop-*"))}
    assert len({entry.name for entry in cache.iterdir()} - others) == 1
    assert (rows(), rows()) == (2, 2)
    write(tmp_path, push=PUSH.replace("[1.0, 0.0]", "[-2.0, 0.0]"))
    assert reached(run) == pytest.approx(-1.0, rel=1e-12)
    assert rows() == 4


def test_keys_of_a_force(tmp_path):
    write(tmp_path, push=PUSH)
    head, entry = SCENE.split("[[linkage.force]]\n")
    messages = {
        entry.replace('"push"\nn', '"psh"\nn'): "line 17: linkage.force[0] (push).type: no force",
        entry.replace('type = "push"\n', ""): "linkage.force[0] (push).type: is missing",
        entry.replace('name = "push"\n', ""): "line 16: linkage.force[0].name: is missing",
        entry + "bdy = 1": "line 19: linkage.force[0] (push).bdy: unknown key; did you mean 'body'",
        entry + "body = 3": "line 19: linkage.force[0] (push).body: 3 should be a valid string",
        entry + 'body = "crt"': "force `push`: the linkage has no 'crt'",
        f"{entry}[[linkage.force]]\n{entry}": "line 21: linkage.force[1] (push).name: 'push' is t",
    }
    for i, text in enumerate(messages):
        (tmp_path / f"{i}.toml").write_text(f"{head}[[linkage.force]]\n{text}")
    lines = (f"hapticlink run {i}.toml --plugin push" for i in range(len(messages)))
    for ended, message in zip(hapticlink(tmp_path, *lines), messages.values(), strict=True):
        assert ended.status == 2
        assert message in ended.said


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("raise BaseException('broken')", "BaseException: broken"),
        ("raise KeyboardInterrupt", "KeyboardInterrupt"),
        ("import os; os._exit(0)", "SystemExit: os._exit(0)"),
        ("class E(Exception):\n    def __str__(self): raise ValueError\nraise E", "cannot be read"),
    ],
)
def test_a_plugin_cannot_end_a_command_without_a_word(tmp_path, monkeypatch, text, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    name = f"ends_{abs(hash(text))}"
    write(tmp_path, **{name: text})
    with pytest.raises(InputFault, match=re.escape(message)):
        plugins.load([name])


@pytest.mark.parametrize("name", ["../x", ".", "..", "x y", "a..b", "/x"])
def test_what_is_no_name_of_a_module_is_said(name):
    with pytest.raises(InputFault, match="no name of a module"):
        plugins.load([name])
