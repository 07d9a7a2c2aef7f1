"""The block diagram shows every FMU and every connection of a system, and no others."""

import pytest
from matplotlib.patches import FancyBboxPatch

import hapticlink as hl
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization.figures import block_diagram


@pytest.mark.parametrize("scene", ["pendulum", "closed-loop-ideal", "two-hands"])
def test_every_connection_is_in_the_cell_of_its_source_and_target(scene: str) -> None:
    with build_system(hl.scene(scene)) as system:
        (axes,) = block_diagram.figure(system, scene).axes
    centers = [
        (box.get_x() + box.get_width() / 2, box.get_y() + box.get_height() / 2)
        for box in axes.patches
        if isinstance(box, FancyBboxPatch)
    ]
    places = {at: fmu.name for at, fmu in zip(centers, system.fmus, strict=True)}
    columns, rows = ({round(at[i], 6): name for at, name in places.items()} for i in (0, 1))
    shown = [
        (rows[y], line.split(",")[0].split(" ")[0], columns[x])
        for text in axes.texts
        for x, y in [tuple(round(c, 6) for c in text.get_position())]
        if text.get_text() and x in columns and y in rows and rows[y] != columns[x]
        for line in text.get_text().split("\n")
    ]
    wanted = [(c.source, c.source_port, c.target) for c in system.connections]
    assert sorted(shown) == sorted(wanted)
