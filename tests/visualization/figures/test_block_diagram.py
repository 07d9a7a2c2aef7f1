"""The block diagram shows every FMU and every connection of a system, and no others."""

import pytest

import hapticlink as hl
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization.figures import block_diagram


@pytest.mark.parametrize("scene", ["pendulum", "closed-loop-ideal", "two-hands"])
def test_every_connection_is_in_the_cell_of_its_source_and_target(scene: str) -> None:
    with build_system(hl.scene(scene)) as system:
        (axes,) = block_diagram.figure(system, scene).axes
    boxes = {t.get_text().split("\n")[0]: t.get_position() for t in axes.texts}
    places = {boxes[fmu.name]: fmu.name for fmu in system.fmus}
    columns = {x: name for (x, _), name in places.items()}
    rows = {y: name for (_, y), name in places.items()}
    shown = [
        (rows[y], line.split(",")[0].split(" ")[0], columns[x])
        for text in axes.texts
        for x, y in [text.get_position()]
        if text.get_text() and x in columns and y in rows and (x, y) not in places
        for line in text.get_text().split("\n")
    ]
    wanted = [(c.source, c.source_port, c.target) for c in system.connections]
    assert sorted(shown) == sorted(wanted)
