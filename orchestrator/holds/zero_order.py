"""Zero-order hold: the newest sample, y_n. Order 1; a delay of half a period at low frequency."""

from __future__ import annotations

from hapticlink.orchestrator.holds.holds_of_samples import OfSamples
from hapticlink.orchestrator.holds.laws_of_holds import LAWS


class ZeroOrder(OfSamples):
    laws = LAWS["ZERO_ORDER"]
    depth = 1
    gives_samples = True
    interpolates = True


class Latest(ZeroOrder):
    """The zero-order hold under the name that it has where a slow target reads a fast source."""

    interpolates = False
    downsamples = True
