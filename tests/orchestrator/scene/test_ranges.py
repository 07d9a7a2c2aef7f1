"""A number out of its range is refused, with its key, its place, the range and the unit."""

import math
import re

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.commands.json_schema import json_schema
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.scene import overrides, read_and_check
from hapticlink.orchestrator.scene.scene_source import Source
from tests.orchestrator.scene_numbers import SCENES, beyond, key, of_scene, put, tables, toml

SCHEMA = jsonschema.Draft202012Validator(json_schema())


@settings(max_examples=150)
@given(st.data())
def test_numbers_of_shipped_scenes_out_of_range(data):
    name = data.draw(st.sampled_from(SCENES), "scene")
    number = data.draw(st.sampled_from(of_scene(name)), "number")
    value = data.draw(beyond(number), "value")
    option = f"{'.'.join(map(str, number.path))}={toml(put(number.value, number.place, value))}"
    with pytest.raises(SceneFault) as refused:
        read_and_check.from_source(Source(name, tables(name), {}, (option,)))
    found = {re.sub(r" \(\w+\)", "", f.key): f for f in refused.value.findings}
    finding = found[key(number)]
    assert finding.option == f"--set {option}"
    limits, unit = number.quantity.range, number.quantity.unit
    assert f"{value!r:.90} is out of range" in finding.message.replace("...", "")
    assert (limits if limits != "finite" else "finite number") in finding.message
    assert unit == "1" or f"({unit})" in finding.message
    if isinstance(value, str) or math.isinf(value) or math.isnan(value):
        return  # JSON has none of these, and a fraction no bound that a pattern could say
    written = tables(name)
    if "family" not in written["linkage"]:
        overrides.apply(written, option)
        assert not SCHEMA.is_valid(written)
