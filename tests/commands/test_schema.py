"""The JSON schema and the reference page of scenes accept and say what the records say."""

from __future__ import annotations

import json
import tomllib
from functools import cache
from pathlib import Path

import jsonschema
import pytest

from hapticlink.commands import json_schema as schema_module
from hapticlink.commands import scene_reference
from hapticlink.commands.json_schema import json_schema
from hapticlink.orchestrator.scene import (
    find_scene,
    read_and_check,
)
from hapticlink.orchestrator.scene.toml_keys import NAMED
from tests.orchestrator.scene.test_scene import GOOD
from tests.shared_fixtures import status

ROOT = Path(__file__).parents[2]


@cache
def validator():
    return jsonschema.Draft202012Validator(json_schema())


def test_the_command_prints_a_valid_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert status("schema") == 0
    printed = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(printed)
    assert printed == json.loads(json.dumps(json_schema()))


def test_a_key_of_another_record_keeps_its_type_beside_a_table_of_that_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`substeps` of the scene is a table by FMU, that of [mechanism] a number."""
    monkeypatch.setattr(schema_module, "NAMED", (*NAMED, "substeps"))
    found = json_schema()
    assert found["properties"]["substeps"]["additionalProperties"]["anyOf"][1] == {"type": "object"}
    assert found["$defs"]["Mechanism"]["properties"]["substeps"]["type"] == "integer"


@pytest.mark.parametrize("name", find_scene.list_shipped())
def test_shipped_scenes_follow_it(name: str) -> None:
    validator().validate(tomllib.loads(find_scene.find_scene(name)[1]))


@pytest.mark.parametrize(
    "more",
    [
        "graphics.rate = '30000/1001'",
        "graphics.rate = [0.5, 1.0]",
        "graphics.rate = { min = 10, max = 60, seed = 4 }",
        "controller.topology = false",
        "controller.topology.stiffness = 3",
        "controller.teleoperation = false",
        "holds.virtual_environment.P_c = 'lead'",
        "delays.'hand.F' = { min = 0.001, loss = 0.1 }",
        "delays.hand.F = 0.001",
    ],
)
def test_every_way_to_write_a_key_follows_it(more: str) -> None:
    text = GOOD.replace("rate = 30\n", "" if more.startswith("graphics") else "rate = 30\n")
    text = f"{more}\n{text.replace('[graphics]', '')}" if "graphics" in more else f"{more}\n{text}"
    if more.startswith("controller"):
        text = text.replace("[controller]\n", "")
    read_and_check.read_scene(text)
    validator().validate(tomllib.loads(text))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("duration = 1.0\n", ""),
        ("mass = 1.0\n", ""),
        ("mass", "mas"),
        ("rate = 30", "rate = 'fast'"),
        ("rate = 30", "rate = { trace = 3 }"),
        ("[controller]", "[controller]\nbias = 'half'"),
        ("[hand]", "[hand]\ntype = 'arm'"),
        ("at = [0.1, 0.0]", "at = [0.1]"),
        ('child = "bar"', "child = 3"),
    ],
)
def test_what_does_not(old: str, new: str) -> None:
    assert validator().is_valid(tomllib.loads(GOOD))
    assert old in GOOD
    assert not validator().is_valid(tomllib.loads(GOOD.replace(old, new)))


def test_the_reference_page_is_up_to_date() -> None:
    """Made by `hapticlink schema --markdown > docs/scene-reference.md`."""
    assert (ROOT / "docs" / "scene-reference.md").read_text(
        encoding="utf-8"
    ) == scene_reference.page()
