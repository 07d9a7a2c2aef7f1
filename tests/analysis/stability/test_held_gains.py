"""Gains that a hold knows, in the map of changed gains."""

import numpy as np

import hapticlink as hl
from hapticlink.analysis.stability.modes import modes
from hapticlink.analysis.stability.poses import in_own_hand

MODEL = {
    "packaging": "native",
    "mechanism_at": "graphics",
    "directions_from": "mechanism",
    "sensing": "ideal",
    "controller.bias": "full",
    "hold": "model",
    "downsampling": "model",
    "graphics.rate": 16,
    "hand": {
        "type": "spring",
        "stiffness": [300.0, 300.0, 0.6],
        "damping": [6.0, 6.0, 0.015],
        "target": [[0.0, 0.04452403, 0.0148015, -0.78780369]],
    },
}
SCALED = {"teleoperation": ([100.0, 100.0, 0.1], [20.0, 20.0, 0.02]), "topology": (200.0, 50.0)}


def growth(scale, told):
    """Of the slowest mode with gains `scale` times, which the scene has, or the map is `told`."""
    gains = {}
    for law, (stiffness, damping) in SCALED.items():
        own = 1.0 if told else scale
        gains[f"controller.{law}.stiffness"] = (np.array(stiffness) * own).tolist()
        gains[f"controller.{law}.damping"] = (np.array(damping) * own**0.5).tolist()
    with in_own_hand(hl.scene("closed-loop-ideal", MODEL | gains)) as (place, _):
        period = place.period(dict.fromkeys(place.gains.laws, scale) if told else {})
        return modes(period.linear, place.map.period)[0].growth


def test_mid_has_the_gains_of_the_coupling_that_are_tried():
    """Its K and B are those of the controller, with which a margin of stiffness is searched."""
    for scale in (0.25, 0.5):
        told, own = (growth(scale, told) for told in (True, False))
        np.testing.assert_allclose(told, own, rtol=1e-3)
