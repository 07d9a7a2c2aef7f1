"""The examples of the pages: files, commands and scripts run as they are printed.

docs/extending.md has a test of its own (tests/test_extending.py), docs/first_steps.py too
(tests/test_public_names.py); docs/api.md is generated from the docstrings.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import jsonschema
import pytest

import hapticlink as hl
from hapticlink.analysis.sweep.grid import parse
from hapticlink.commands import COMMANDS, _commands, app
from hapticlink.commands.json_schema import json_schema
from hapticlink.commands.options import UNCHANGED
from hapticlink.orchestrator.scene import find_scene
from tests.docs.pages import PAGES, ROOT, Block, blocks, name, prose
from tests.plugins import hapticlink

ELSEWHERE = {"docs/extending.md", "docs/api.md"}
WITH_EXAMPLES = [p for p in PAGES if name(p) not in ELSEWHERE and [*blocks(p, "sh", "python")]]
SHIPPED = tuple(find_scene.list_shipped())
SHORTER = {"hapticlink sweep": 0.02} | {
    f"hapticlink run {name}": 0.2 for name in (*SHIPPED, "watt.toml")
}
"""Duration (s) of commands that take longer than their page needs."""
NOT_RUN = {
    "hapticlink sweep closed-loop-ideal --set controller.bias=full --vary graphics.rate=10..60..5 "
    "--vary hold=zoh,lead,foh":
        "33 runs; docs/rates.md has a sweep that is run",
    "hapticlink sweep closed-loop-direct --vary graphics.rate=10..60..10 --vary hold=zoh,foh":
        "many runs; docs/rates.md has a sweep that is run",
    "hapticlink sweep closed-loop-direct --vary graphics.rate=10..60..10 --vary hold=zoh,lead,foh":
        "many runs",
    "hapticlink sweep first/at-0.1.state --vary hold=zoh,foh":
        "sweeps are shorter here than its state; tests/orchestrator/run/test_run_state.py",
    "hapticlink stability virtual-wall --set fmu.wall.settings.unilateral=false "
    "--set 'hand.wrench=[0.0, 0.0, 0.0]' --set fmu.wall.settings.damping=1.0 "
    "--vary fmu.wall.start.damping=0.5..60.5:9 --vary fmu.wall.start.stiffness=200..12200:9 "
    "--vary haptics.rate=512,1024 --vary 'holds.\"wall.F\"=zoh,foh' "
    "--vary 'delays.\"wall.F\"=0,0.001953125' --check 180 --seed 1 --out results/stability/wall":
        "700 points; tests/analysis/maps/test_maps.py",
    "hapticlink tune closed-loop-ideal --set sensing=encoders":
        "takes minutes; tests/analysis/tune/test_tune.py",
    "hapticlink tune closed-loop --set sensing=encoders":
        "takes minutes; tests/analysis/tune/test_tune.py",
    "hapticlink tune enclosure --set sensing=encoders --margin 2 --out tuned/enclosure":
        "takes minutes; tests/analysis/tune/test_tune.py",
    "hapticlink --install-completion":
        "writes to the files of the user's shell; tests/commands/test_options.py",
    "hapticlink study": "thousands of runs; tests/studies/mismatch/test_study.py",
    "hapticlink reproduce": "its runs: tests/reference/test_closed_loop.py",
    "hapticlink bench mechanism": "needs other codes",
    "hapticlink bench singular": "is long",
    "hapticlink bench cosimulation": "is long",
    "hapticlink bench skip": "is long",
    "hapticlink bench master": "is long, and measures the machine",
    "hapticlink bench real-time": "takes a minute, and measures the machine",
    "hapticlink bench stress": "is long; its short form: tests/reference/test_stress.py",
    "hapticlink fit shaken.csv": "of a log of one's own; tests/analysis/fit",
    "hapticlink report runs/closed-loop": "of a run that is shorter here, elsewhere; replay.md",
    "hapticlink compare runs/closed-loop "
    "runs/closed-loop,controller.topology=false": "as its runs; replay.md",
    "hapticlink stability held.toml --equilibrium "
    "--set 'controller.teleoperation.stiffness=[500.0, 500.0, 0.5]'":
        "as the one above it on its page",
    "hapticlink bench advise": "thousands of runs; tests/analysis/advise/test_advise.py",
    "hapticlink bench sweep": "minutes; tests/reference/test_bench_sweep.py",
    "hapticlink bench waiting": "minutes; tests/reference/test_waiting.py",
    "hapticlink bench foreign": "downloads packages; tests/reference/test_foreign.py",
    "hapticlink bench network": "takes a minute, and measures the machine",
    "hapticlink bench one": "takes minutes, and measures the machine",
    "hapticlink bench standalone": "takes minutes, and measures the machine",
    "hapticlink bench view": "takes a minute, and measures the machine",
    "hapticlink build closed-loop-ideal --set packaging=native --all-platforms --out fmus":
        "compiles for five machines; tests/orchestrator/scene/test_packaging.py",
    "hapticlink sweep closed-loop-ideal --vary graphics.rate=10..60 --scheduler tcp://10.0.0.5:8786":
        "needs a cluster; tests/analysis/sweep/test_sweep.py",
    "hapticlink run their.ssp --set haptics.rate=100 --set duration=10 --set fmu.engine.rate=20":
        "is of somebody else's file; tests/orchestrator/ssp/test_ssp.py",
    "hapticlink run their.ssp --set haptics.rate=100 --set duration=10":
        "is of somebody else's file; tests/orchestrator/ssp/test_ssp.py",
    "hapticlink run OspSystemStructure.xml --set duration=10":
        "is of somebody else's file; tests/orchestrator/ssp/test_osp.py",
    "hapticlink run their.ssp --set-file cold.ssv":
        "is of somebody else's file; tests/orchestrator/ssp/test_set_files.py",
}  # fmt: skip
"""Commands that are parsed, with their scene, keys and values, but not run; the reason."""
UNTIL_STOPPED = re.compile(r"hapticlink (view\b(?!.*--export)|serve )")
"""Commands that run until Ctrl-C, parsed but not run; tests/visualization/live_page."""
TOOLS = ("fmpy", "pythonfmu")
"""Commands of other packages, which are installed beside Python."""


def shown(command: str, page: Path) -> str:
    """A command as it is run: some with a shorter duration; without the figures of a run, which
    tests/visualization has, but on the page that shows them."""
    limits = (f" --set duration={limit}" for key, limit in SHORTER.items() if key in command)
    undrawn = command.startswith("hapticlink run ") and page.stem != "first-run"
    return command + next(limits, "") + " --no-figures" * (undrawn and "--no-fig" not in command)


def first_pages() -> dict[str, Path]:
    """Each command without files of a page, with the first page that has it, where it is run."""
    alone = re.compile(rf"hapticlink (doctor|schema|\w+ ({'|'.join(SHIPPED)}))( (?!.*--out)|$)")
    return {
        command: page
        for page in reversed(WITH_EXAMPLES)
        for block in blocks(page, "sh")
        for command in block.commands
        if alone.match(command)
    }


FIRST_PAGES = first_pages()


def failures(folder: Path, page: Path, block: Block) -> dict[str, str]:
    """Executes a block in `folder`; what each of its commands that failed has printed."""
    if block.title:
        (folder / block.title).write_text(block.text, encoding="utf-8")
        return {}
    if block.language == "python":
        return _failed(folder, sys.executable, "-c", block.text)
    failed = {}
    for command in block.commands:
        words = shlex.split(command)
        if command in NOT_RUN or UNTIL_STOPPED.match(command):
            continue
        if FIRST_PAGES.get(command, page) != page:
            continue
        if words[0] == "hapticlink":
            (ended,) = hapticlink(folder, shown(command, page))
            failed |= {command: ended.said} if ended.status else {}
        elif words[0] in TOOLS or (words[0] == "python" and (folder / words[1]).exists()):
            failed |= _failed(folder, str(Path(sys.executable).with_name(words[0])), *words[1:])
    return failed


def _failed(folder: Path, *words: str) -> dict[str, str]:
    done = subprocess.run(
        words, cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "MPLBACKEND": "agg"},
    )  # fmt: skip
    return {" ".join(words): done.stdout + done.stderr} if done.returncode else {}


@pytest.mark.parametrize("page", WITH_EXAMPLES, ids=name)
def test_the_examples_of_a_page_run(page: Path, tmp_path: Path) -> None:
    failed: dict[str, str] = {}
    for block in blocks(page, "toml", "python", "c", "sh"):
        if block.title or block.language != "toml":
            failed |= failures(tmp_path, page, block)
    assert failed == {}


def every_command(page: Path) -> list[str]:
    """The commands in the shell blocks of a page and within its text, except for those of which it
    only gives the name."""
    inline = re.findall(r"`(hapticlink [^`]+)`", prose(page))
    several = [c.strip() for text in inline for c in text.partition(" > ")[0].split(";")]
    found = [*several, *(c for block in blocks(page, "sh") for c in block.commands)]
    named = {f"hapticlink {name}" for name in COMMANDS} - {"hapticlink info", "hapticlink schema"}
    ours = re.compile(rf"hapticlink ({'|'.join(COMMANDS)})( |$)")
    return [command for command in found if ours.match(command) and command not in named]


PARSED = [p for p in PAGES if name(p) not in ELSEWHERE and every_command(p)]


@pytest.mark.parametrize("page", PARSED, ids=name)
def test_every_command_can_be_parsed(page: Path) -> None:
    """Options, and keys and values of shipped scenes; those of sweeps too, one axis at a time."""
    _commands([])
    for command in every_command(page):
        parsed(command)


@cache
def parsed(command: str) -> None:
    """Words, keys and values of a command; those of a scene whose file of --swap may not be there
    are left alone. Many pages have the same commands."""
    _, bound, _ = app.parse_args(shlex.split(command)[1:], exit_on_error=False)
    scene = bound.args[0] if bound.args else None
    if scene in SHIPPED:
        axes = [parse(text) for text in bound.kwargs.get("vary") or ()]
        changes = bound.kwargs.get("changes", UNCHANGED)
        given = [*(changes.set or ()), *(bound.kwargs.get("set") or ())]
        if changes.swap:
            return
        first = [f"{axis.key}={axis.values[0]}" for axis in axes]
        varied = [f"{axis.key}={value}" for axis in axes for value in axis.values[1:]]
        for option in ("", *varied):
            hl.scene(scene, [*given, *first, *filter(None, [option])])


def test_extras_that_are_installed_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    text = "".join(block.text for page in PAGES for block in blocks(page, "sh"))
    named = set(re.findall(r"(?:'\.|\"hapticlink)\[(\w+)\]['\"]", text))
    assert named >= {"test", "native", "view"}
    assert named <= {*project["optional-dependencies"]}


WITH_EXCERPTS = [p for p in PAGES if name(p) not in ELSEWHERE and [*blocks(p, "toml")]]


@pytest.mark.parametrize("page", WITH_EXCERPTS, ids=name)
def test_excerpts_of_scenes_follow_the_schema(page: Path) -> None:
    """Tables and keys, without the rest of their scene."""
    valid = jsonschema.Draft202012Validator(json_schema())
    for block in blocks(page, "toml"):
        found = tomllib.loads(block.text)
        found = {"device": found} if "handle" in found else found  # a device file
        valid.validate({"extends": "any", **found})
