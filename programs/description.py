"""The description of a program, and its page of documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import PurePosixPath

from hapticlink.components.ports import BASES
from hapticlink.fmus.description_common import Described, base_attributes
from hapticlink.fmus.documentation import PAGE, page, table
from hapticlink.orchestrator.fmi.units import Unit
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.programs.ports import Port


def describe_program(
    scene: Scene,
    identifier: str,
    ports: Sequence[Port],
    *,
    capable: Mapping[str, str],
    step_size: float,
) -> Described:
    """A program. capable: its capabilities, as FMI 2.0 calls them. step_size (s): of the default
    experiment. FMUs of others name their variables as they like."""
    return Described(
        identifier,
        scene.title,
        ports,
        {port.unit: _base(port.unit, port.defined) for port in ports if port.unit},
        float(scene.duration),
        step_size,
        capable,
        naming="flat" if any(fmu.path for fmu in scene.fmu) else "structured",
    )


def _base(name: str, unit: Unit | None) -> dict[str, str] | None:
    """The attributes of the BaseUnit of a unit, which an FMU of others may define by itself."""
    if unit is None:
        return base_attributes(name)
    if unit.base is None:
        return None
    powers = {b: str(n) for b, n in zip(BASES, unit.base, strict=True) if n}
    return powers | {"factor": repr(unit.factor), "offset": repr(unit.offset)}


def make_documentation(
    scene: Scene, ports: Sequence[Port], pictures: Mapping[str, bytes]
) -> dict[str, bytes]:
    """An HTML page without references to elsewhere, and the files of its pictures."""
    images = {f"picture{i}.png": data for i, data in enumerate(pictures.values())}
    body = [
        f"<h1>{escape(scene.title)}</h1>",
        *(f"<p>{escape(part)}</p>" for part in scene.description.split("\n\n") if part.strip()),
        "<p>A scene of hapticlink as one FMU: its blocks, each at its own rate, with the holds "
        "between them. A communication step that ends between two ticks of the scene takes it to "
        "the last tick before.</p>",
        *(
            f'<figure><img src="{image}" alt="{escape(caption)}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>"
            for image, caption in zip(images, pictures, strict=True)
        ),
    ]
    for title, kinds in (
        ("Inputs", ("INPUT", "OUTSIDE")),
        ("Parameters", ("PARAMETER",)),
        ("Outputs", ("OUTPUT",)),
        ("Measured", ("ENERGY", "STEP_ERROR")),
    ):
        rows = (_cells(port) for port in ports if port.kind in kinds)
        body += table(title, ("name", "unit", "start", "description"), rows)
    return {PAGE: page(scene.title, body)} | {
        f"{PurePosixPath(PAGE).parent}/{image}": data for image, data in images.items()
    }


def _cells(port: Port) -> tuple[str, ...]:
    start = "" if port.start is None else repr(float(port.start))
    return port.name, port.unit, start, port.description
