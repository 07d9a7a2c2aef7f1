"""What is measured of a run.

Tracking: the largest |x_S - x_D| (mm, rad). Force: the error of F_hand (N, N.m; root mean square,
and the largest of the force). Vibration: root mean square of the handle's true displacement above
VIBRATION Hz (um). Energy: the peak of what the user's port generated (mJ).
"""

from __future__ import annotations

import numpy as np

from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.sweep.row import Row
from hapticlink.orchestrator.experiment import Experiment

ERROR, ANGLE, FORCE, PEAK = "tracking_mm", "tracking_rad", "force_rms_N", "force_max_N"
MOMENT, ENERGY, SHAKES = "moment_rms_N.m", "generated_mJ", "vibration_um"
NUMBERS = (ERROR, ANGLE, FORCE, PEAK, MOMENT, ENERGY, SHAKES)
VIBRATION = 60.0


def of_run(experiment: Experiment) -> Row:
    results = experiment.results
    table, port = results.haptics, Measures(results).port
    handle = table["haptic_device.x_true"]
    apart = table["virtual_mechanism.x"] - handle
    wrench = table["hand.F"]
    seen = next((f"{b}.F_hand_observed" for b in ("observer", "haptic_device")
                 if f"{b}.F_hand_observed[1]" in table.columns), None)  # fmt: skip
    off = wrench - table[seen] if seen else np.zeros_like(wrench)
    force = np.linalg.norm(off[:, :2], axis=1)
    assert port is not None
    return {
        "end": results.record.end.reason,
        ERROR: 1e3 * float(np.linalg.norm(apart[:, :2], axis=1).max()),
        ANGLE: float(np.abs(apart[:, 2]).max()),
        FORCE: float(np.sqrt(np.mean(force**2))),
        PEAK: float(force.max()),
        MOMENT: float(np.sqrt(np.mean(off[:, 2] ** 2))),
        ENERGY: 1e3 * port.peak,
        SHAKES: vibration(handle[:, :2], float(experiment.scene.haptics.rate)),
    }


def vibration(path: np.ndarray, rate: float) -> float:
    """The root mean square (um) of what a path (m), (n, 2), sampled at a rate (Hz), has above
    VIBRATION Hz, under a Hann window, whose mean square is 3/8."""
    n = len(path)
    spectrum = np.fft.rfft((path - path.mean(axis=0)) * np.hanning(n)[:, None], axis=0)
    spectrum[np.fft.rfftfreq(n, 1 / rate) < VIBRATION] = 0
    rest = np.fft.irfft(spectrum, n, axis=0)
    return 1e6 * float(np.sqrt((rest**2).sum(axis=1).mean() * 8 / 3))
