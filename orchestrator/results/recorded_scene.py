"""The scene of a run as run.json has it: parts of it as records, all of it as a scene file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import DEVICE, block_of_user, by_user
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.run_record import first_error
from hapticlink.orchestrator.scene.overrides import toml


def scene_part(results: Results, name: str, kind: Any) -> Any:
    """The table `name` of a run's scene as a record of `kind`, None where the scene has none.
    Raises InputFault where it is not as this version writes it."""
    if (known := results.known_scene) is not None:
        return getattr(known, name)
    try:
        given = results.record.scene[name]
        return None if given is None else adapter(kind).validate_python(given)
    except KeyError:
        why = "is missing"
    except ValidationError as error:
        why = first_error(error)
    raise InputFault(f"{results.folder}/run.json: scene.{name} {why}: run the scene again")


def all_devices(results: Results) -> dict[str, Device]:
    """The devices of all users of a run, as `by_user`."""
    others = scene_part(results, "devices", Mapping[str, Device])
    return by_user(scene_part(results, "device", Device), others or {})


def described_devices(results: Results) -> dict[str, Device]:
    """The devices that are as [device] says: not those in whose place an FMU from elsewhere is,
    except where the observer beside it goes by [device]."""
    replaced = {fmu.get("replaces") for fmu in results.record.scene.get("fmu", ())}
    return {
        user: device
        for user, device in all_devices(results).items()
        if device.observer.beside or block_of_user(DEVICE, user) not in replaced
    }


def scene_file(run: Results) -> str:
    """The text of a scene file that stands alone: what run.json has of the scene."""
    scene = _without_none(run.record.scene)
    tables = {key: value for key, value in scene.items() if isinstance(value, Mapping)}
    lines = [f"{key} = {_value(key, v)}" for key, v in scene.items() if key not in tables]
    for key, table in tables.items():
        lines += ["", *_table(key, table)]
    return "\n".join(lines) + "\n"


def _table(name: str, table: Mapping[str, Any]) -> Iterator[str]:
    yield f"[{name}]"
    for key, value in table.items():
        yield f"{_key(key)} = {_value(key, value)}"


def _value(key: str, value: Any) -> str:
    if not _tables(value):
        return toml(value, key)
    return "[\n" + "".join(f"  {toml(row, key)},\n" for row in value) + "]"


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() else toml(key, key)


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        # A key that is a word of Python has an underscore in its record: `from_`.
        return {k.removesuffix("_"): _without_none(v) for k, v in value.items() if v is not None}
    return [_without_none(entry) for entry in value] if isinstance(value, list) else value
