from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

Markdown = Annotated[
    bool, Parameter(negative="", help="Print the reference page, docs/scene-reference.md, instead.")
]


def schema(*, markdown: Markdown = False) -> int:
    """Print every key of a scene with unit, range and meaning, as a JSON schema (draft 2020-12)
    with which editors complete and check scenes.

    For example, with `#:schema scene.schema.json` as the first line of a scene:

        hapticlink schema > scene.schema.json
    """
    import json

    from hapticlink.commands import json_schema, scene_reference
    from hapticlink.orchestrator.base import plugins
    from hapticlink.orchestrator.plan.schemes import SCHEMES as SCHEMES  # a scene names them too

    plugins.load_installed()
    if markdown:
        print(scene_reference.page(), end="")
    else:
        print(json.dumps(json_schema.json_schema(), indent=2))
    return 0
