"""The observer as a block beside the device: what it puts out is that of the one within it, and the
acceleration that of the motion."""

from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.blocks.motor_map import motor_map
from hapticlink.components.blocks.observer import observer
from hapticlink.components.specs.device import Observer
from tests.blocks import Running
from tests.devices import device

T = 1 / 512
START = (-0.02, 0.01, 3.6)
HAND, MOTORS = (0.2, -0.1, 0.001), (-0.05, 0.02, 0.0005)


class Beside:
    """Device, observer and motor map, stepped as Gauss-Seidel does."""

    def __init__(self, device, **inputs):
        start = {"x_start": START}
        self.plant = Running(haptic_device(device, encoders=True), inputs, start)
        self.observer = Running(observer(device), self.measured, start)
        self.map = Running(motor_map(device))

    @property
    def measured(self):
        return {"q": self.plant.y["q"], "tau": self.plant.y["tau_applied"]}

    def step(self, h, F_motor):
        """What the observer sees at the beginning of the step."""
        self.observer.set(**self.measured)
        seen = self.observer.y
        self.map.set(F_motor=F_motor, x=seen["x"])
        self.observer.step(h)
        self.plant.set(tau=self.map.y["tau"])
        self.plant.step(h)
        return seen


@pytest.mark.parametrize(
    "own", [*({"rule": r} for r in ("forward", "backward", "trapezoidal")), {"law": "kalman"}]
)
def test_beside_the_device_it_sees_the_same_bits_at_any_steps(own):
    def spec(beside):
        return replace(device(), observer=Observer(**own, beside=beside))

    within = Running(haptic_device(spec(False), True), {"F_hand": HAND}, {"x_start": START})
    beside = Beside(spec(True), F_hand=HAND)
    for k in range(200):
        motors = np.sin(0.1 * k) * np.array(MOTORS)
        within.set(F_motor=motors)
        y, h = within.y, T * (1 + k % 3)
        seen = beside.step(h, motors)
        for name in ("x", "v", "F_hand_observed", "M", "c"):
            assert seen[name].tobytes() == y[name].tobytes(), (name, k)
        within.step(h)
    assert np.abs(seen["v"]).max() > 0.1


def test_it_starts_at_rest_at_the_pose_of_its_angles():
    seen = Beside(replace(device(), observer=Observer(beside=True))).step(T, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(seen["x"], START, atol=6e-3)
    for name in ("v", "a", "F_hand_observed", "c"):
        np.testing.assert_array_equal(seen[name], 0)


@pytest.mark.parametrize("law", ["nicosia", "kalman"])
def test_the_acceleration_is_that_of_the_true_motion(law):
    """With fine encoders and known torques, against differences of the true velocity over a step,
    the acceleration in the middle of it."""
    spec = Observer(law=law, omega_n=50.0, beside=True)
    system = Beside(replace(device(keys={"encoder.resolution": 1e-9}), observer=spec))
    v, a = [], []
    for _ in range(240):
        a.append(system.step(T, MOTORS)["a"])
        v.append(system.plant.y["v_true"])
    middle = (np.array(a)[:-1] + np.array(a)[1:])[1:] / 2
    true = np.diff(v, axis=0)[: len(middle)] / T
    scale = np.abs(true).max(axis=0)
    assert np.all(np.abs(middle - true)[100:] < 0.02 * scale)
    assert np.all(scale > (0.1, 0.05, 1.0))
