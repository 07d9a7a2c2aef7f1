"""Parts of the scene of a run, as run.json has them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import by_user
from hapticlink.orchestrator.results.run_record import first_error
from hapticlink.orchestrator.results.tables import Results


def scene_part(results: Results, name: str, kind: Any) -> Any:
    """The table `name` of a run's scene as a record of `kind`, None where the scene has none.
    Raises InputFault where it is not as this version writes it."""
    try:
        given = results.record.scene[name]
        return None if given is None else _adapter(kind).validate_python(given)
    except KeyError:
        why = "is missing"
    except ValidationError as error:
        why = first_error(error)
    raise InputFault(f"{results.folder}/run.json: scene.{name} {why}: run the scene again")


def all_devices(results: Results) -> dict[str, Device]:
    """The devices of all users of a run, as `by_user`."""
    others = scene_part(results, "devices", Mapping[str, Device])
    return by_user(scene_part(results, "device", Device), others or {})


@cache  # which takes longer to make than most figures take to draw
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
