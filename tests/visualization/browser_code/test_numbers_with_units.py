"""Numbers with their units, as the page writes them."""

import pytest

from tests.visualization.browser_code.javascript import javascript


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (0.004, "N", "0 N"),  # nobody feels it
        (1.234, "N", "1.23 N"),
        (-12.34, "mm", "-12.3 mm"),
        (4321.0, "N", "4321 N"),
        (1.1954930272257646e61, "N", "1.2e+61 N"),  # of a run that diverged
        (3e-6, "m", "3e-6 m"),
        (3, "count", "3"),
    ],
)
def test_three_digits_are_enough(value: float, unit: str, said: str) -> None:
    assert javascript("canvas.js", "answer = text(...given);", [value, unit]) == said
