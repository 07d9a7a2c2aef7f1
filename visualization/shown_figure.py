"""A figure that a notebook shows as the value of a cell, without pyplot and its list of figures."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A Matplotlib figure with a picture of itself, at twice the dots of its size in a cell."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        file = BytesIO()
        self.savefig(file, format="png", dpi=200)
        return file.getvalue(), {"width": round(100 * self.get_figwidth())}
