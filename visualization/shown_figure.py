"""A figure that a notebook shows as the value of a cell, without pyplot and its list of figures."""

from __future__ import annotations

from matplotlib.figure import Figure

from hapticlink.visualization.figure_files import encode


class ShownFigure(Figure):
    """A Matplotlib figure with a picture of itself, at twice the dots of its size in a cell."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        return encode(self, "png", 200), {"width": round(100 * self.get_figwidth())}
