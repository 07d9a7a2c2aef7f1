"""What `hapticlink bench sweep` compares: the same points for all, ratios of what was measured."""

from __future__ import annotations

import random

import pytest

import hapticlink as hl
from benchmarks import sweep

FORMS = [
    ("sweep", 12.0, "3"),
    ("one by one", 15.0, "6"),
    ("runs alone", 36.0, "6"),
    ("FMPy", 18.0, ""),
]
ROWS = [
    {"key": key, "form": form, "point_ms": f"{point}", "loop_ms": loop}
    for key in sweep.KEYS
    for form, point, loop in FORMS
    if form != "FMPy" or key in ("gains", "hand", "start")
]
IMPORTS = {"key": "imports", "form": "a worker", "point_ms": "600", "loop_ms": ""}


def test_its_page_has_the_ratios_of_its_rows() -> None:
    page = sweep._page([*ROWS, IMPORTS], "hapticlink bench sweep", 0.5)
    assert "takes 2.00 to 2.00 times what its event loop takes" in page
    assert "eight runs side by side go through 2.00 to 2.00 times as fast" in page
    assert "FMPy takes 1.50 to 1.50 times as long for a point" in page
    assert "as long as 50 points" in page
    assert "load average of 0.5" in page
    assert "| rates | runs alone | 36.0 | 6.00 |" in page


@pytest.mark.parametrize("key", ["gains", "hand", "start"])
def test_fmpy_is_given_the_values_of_the_point(key: str) -> None:
    """The start values of the FMU that the scene with the point's options has."""
    point = sweep._draw(key, random.Random(3))
    given = dict(sweep._parameters(point))
    scene = hl.scene(sweep.SCENE, [f"{k}={v}" for k, v in point.items()])
    if key == "gains":
        expected = dict(enumerate(scene.controller.teleoperation.damping, 1))
        assert given == {f"controller.B_pc[{i}]": v for i, v in expected.items()}
    elif key == "hand":
        assert given == {f"hand.wrench[{i}]": v for i, v in enumerate(scene.hand.wrench, 1)}
    else:
        start = [scene.linkage.start[name] for name in sweep.JOINTS]
        for block in ("virtual_mechanism", "virtual_environment"):
            assert [given[f"{block}.q_start[{i}]"] for i in (1, 2, 3, 4)] == start
