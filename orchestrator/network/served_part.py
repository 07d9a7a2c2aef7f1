"""The part of a scene that is served: by name, and what both computers have to agree on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hapticlink.fmus.versions import version
from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.network.key_file import DEFAULT, read_key
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import Fmu, ServedAt, System

OF_A_RUN = ("title", "description", "duration", "record")
"""Keys of a scene that concern a run, and not what it simulates."""
PACKAGES = ("hapticlink", "casadi", "pythonfmu")
"""Those that make FMUs."""
Identity = dict[str, str]


def fmus_of(system: System, part: str) -> list[str]:
    """The FMUs of a part: an FMU, or all FMUs of a clock. Raises InputFault for other names."""
    if part in system.fmu:
        return [part]
    clocks = [clock.name for clock in system.timeline.clocks]
    if part not in clocks:
        raise InputFault(unknown("FMU or clock", part, [*system.fmu, *clocks]))
    return [fmu.name for fmu in system.fmus if fmu.clock == part]


@dataclass(frozen=True)
class Servers:
    """What runs on other computers: by part, FMUs or clocks, the address HOST:PORT of its server;
    and the file of the key of all."""

    addresses: Mapping[str, str]
    key: Path = DEFAULT


NOWHERE = Servers({})


def place_remote_fmus(system: System, scene: Scene, remote: Servers) -> System:
    """The system with the FMUs of each part of `remote` at its server."""
    served = {
        name: ServedAt(require_address(address), remote.key, identity(scene, system.fmu[name]))
        for part, address in remote.addresses.items()
        for name in fmus_of(system, part)
    }
    if served:
        read_key(remote.key)  # raises what is missing before anything runs
    fmus = (replace(u, in_its_place=served.get(u.name, u.in_its_place)) for u in system.fmus)
    return replace(system, fmus=tuple(fmus))


def require_address(address: str) -> str:
    """Raises InputFault for an address that is not HOST:PORT."""
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isascii() and port.isdigit() and int(port) < 65536):
        raise InputFault(f"address {address!r}: write HOST:PORT, e.g. 127.0.0.1:5555")
    return address


def identity(scene: Scene, fmu: Fmu) -> Identity:
    """What has to be equal on both sides: the resolved scene, as a hash of each of its keys, its
    FMU, and the versions of what made it."""
    plain = scene.tables()
    for table in plain["fmu"]:
        table["path"] = Path(table["path"]).name if table["path"] else None
    tables = {f"scene {k}": _digest(v) for k, v in plain.items() if k not in OF_A_RUN}
    return tables | {"guid": fmu.description.guid} | {name: version(name) for name in PACKAGES}


def _digest(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def differences(here: Identity, there: Mapping[str, Any]) -> Iterator[str]:
    """What differs between two sides, in words."""
    for name in dict.fromkeys([*here, *there]):
        if (ours := here.get(name)) != (theirs := there.get(name)):
            yield f"{str(name)[:40]} ({ours} on the server, {str(theirs)[:40]} in the run)"
