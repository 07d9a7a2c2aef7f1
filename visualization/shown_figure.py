"""A figure that a notebook shows as the value of a cell, without pyplot and its list of figures."""

from __future__ import annotations

from matplotlib.figure import Figure

from hapticlink.visualization.figure_axes import png


class ShownFigure(Figure):
    """A Matplotlib figure with a picture of itself."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        return png(self), {"width": round(100 * self.get_figwidth())}
