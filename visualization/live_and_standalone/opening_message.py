"""The message with which a page opens, before anything runs: the mechanism where it starts."""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticlink.analysis.findings.user_port import NOTICEABLE_J
from hapticlink.components.dynamics.assembly import start_coordinates
from hapticlink.visualization.mechanism.marks import KINDS, SHAPES
from hapticlink.visualization.mechanism.picture import PORT, Picture


def opening(title: str, *drawing: Any) -> dict[str, Any]:
    """The `picture` of a `drawing`, the arguments of Picture; what `drawn` says of it; a `frame` of
    it at the start, None where its loops lead to no finite pose."""
    picture, q = Picture(*drawing), start_coordinates(drawing[0])
    frame = picture.at_rest(q) if np.isfinite(q).all() else None
    about = {"type": "opening", "title": title, "picture": picture, "frame": frame}
    return about | drawn(picture)


def drawn(picture: Picture) -> dict[str, Any]:
    """Of the drawing: `marks` and the `shapes` that they name, what states mean (`kinds`), the name
    of the user's `port`, and the `noticeable` energy (J)."""
    return {
        "marks": [mark._asdict() for mark in picture.marks],
        "shapes": SHAPES,
        "kinds": KINDS,
        "port": PORT,
        "noticeable": NOTICEABLE_J,
    }
