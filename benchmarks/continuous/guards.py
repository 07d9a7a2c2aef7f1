"""Where the number of constrained directions changes, in continuous time.

With the eigenvalues s_1 <= s_2 <= s_3 of S Lambda^-1 S and n directions constrained, one more is
where s_{n+1} falls below rank_tolerance s_3, one less where s_n rises above hysteresis times that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.orchestrator.scene.scene import Scene


class Guards:
    """The guards of a mode, n; they fall through 0 where it changes."""

    def __init__(self, scene: Scene, mobility: Callable[[np.ndarray], np.ndarray]) -> None:
        spec = scene.directions
        assert scene.linkage
        length = spec.length_scale or mean_link_length(scene.linkage)
        self.scale = np.array([1.0, 1.0, length])
        self._mobility = mobility
        self._tolerance, self._hysteresis = spec.rank_tolerance, spec.hysteresis

    def _shares(self, y: np.ndarray) -> np.ndarray:
        s = np.linalg.eigvalsh(self.scale[:, None] * self._mobility(y) * self.scale)
        return s / s[-1]

    def more(self, y: np.ndarray, mode: int) -> float:
        return float(self._shares(y)[mode] - self._tolerance) if mode < 3 else 1.0

    def less(self, y: np.ndarray, mode: int) -> float:
        if not mode:
            return 1.0
        return float(self._tolerance * self._hysteresis - self._shares(y)[mode - 1])
