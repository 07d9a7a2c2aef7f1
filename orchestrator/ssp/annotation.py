"""What the standard does not say of a system, read from the annotation of an SSP: rates, holds,
coupling. It comes from anywhere, so it names no files: an FMU is an entry of the archive, and a
recorded trace of frames stands in it as its times."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any
from xml.etree.ElementTree import Element

from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.scene.rates import find_traces
from hapticlink.orchestrator.scene.refused_keys_and_values import find_unrepresentable
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem
from hapticlink.orchestrator.ssp.names import (
    ANNOTATION,
    NOT_IN_ANNOTATION,
    OF_GRAPHICS,
    RUN,
    SSC,
    SSD,
)

OF_AN_FMU = ("rate", "timing", "tolerance", "isolate", "hardware", "derivatives")


def read_run_annotation(path: FilePath, root: Element) -> dict[str, Any]:
    """The annotation's tables, by the keys of a scene but `fmu` by names; empty where there is
    none. Raises InputFault for what `write` never writes."""
    for annotation in root.iterfind(f"{{{SSD}}}Annotations/{{{SSC}}}Annotation"):
        if annotation.get("type") == ANNOTATION:
            try:
                tables = json.loads(annotation.findtext(f"{{{RUN}}}Scene") or "")
            except (ValueError, RecursionError) as error:
                raise InputFault(f"{path}: annotation {ANNOTATION}: {error}") from error
            for where, message in _problems(tables):
                problem = ": ".join((".".join(map(str, where)), message))
                raise InputFault(f"{path}: annotation {ANNOTATION}: {problem}")
            assert isinstance(tables, dict)
            return tables
    return {}


def _problems(tables: Any) -> Iterator[Problem]:
    """What is wrong, the first of which is reported: later ones may presume it."""
    yield from find_unrepresentable(tables)
    own = {f.name for f in fields(Scene)} - NOT_IN_ANNOTATION
    yield from _table(tables, (), own | {"graphics", "fmu", "connection"})
    yield from _table(tables.get("graphics", {}), ("graphics",), OF_GRAPHICS)
    fmus = tables.get("fmu", {})
    yield from _table(fmus, ("fmu",), fmus)
    for name, fmu in fmus.items():
        yield from _table(fmu, ("fmu", name), OF_AN_FMU)
    if not isinstance(tables.get("connection", []), list):
        yield ("connection",), "should be a list"
    for where, _ in find_traces({"graphics": tables.get("graphics"), "fmu": [*fmus.values()]}):
        yield (*where, "rate"), "a trace is a file outside the SSP: name it with --set yourself"


def _table(value: Any, path: Path, known: Collection[str]) -> Iterator[Problem]:
    if not isinstance(value, dict):
        yield path, "should be a table"
    elif wrong := [key for key in value if key not in known]:
        yield (*path, wrong[0]), f"does not belong here; {unknown('key', wrong[0], sorted(known))}"
