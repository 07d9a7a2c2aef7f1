"""Two users on one linkage against absolute coordinates with a multiplier for every joint, which
share nothing with the blocks but the scene: mobilities and forces between the points, a point that
the other user holds still, and the whole loop as rates go up."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.analysis.findings.user_port import user_port
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Mechanism
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate
from tests.blocks import Running, virtual_environment, virtual_mechanism
from tests.reference.absolute_coordinates import Absolute

SCENES = {"two-users": "left", "pantograph": "pen"}
"""By scene, the point of the second user."""


def shipped(name):
    return open_scene.load(name).linkage


class Points(Absolute):
    """The linkage with the poses (6,) of its operational point and its first further one."""

    def __init__(self, linkage, q, qd):
        super().__init__(linkage, q, qd)
        at = (linkage.operational_point, linkage.point[0])
        pose = [ca.vertcat(self._point(p.body, p.at), self._frame(p.body)[1]) for p in at]
        x, v = ca.vertcat(*pose), ca.SX.sym("v", self.n)
        J = ca.jacobian(x, self._z)
        self.of_points = ca.Function("points", [self._z, v], [x, J, ca.jtimes(J @ v, self._z, v)])

    def solve(self, z, v, forces, pinned=()):
        """Accelerations under `forces` (n, k), with the rows `pinned` of the points' pose held."""
        W, w, Q, _ = (np.array(m) for m in self._of(z, v))
        _, J, Jv = (np.array(m) for m in self.of_points(z, v))
        W, w = np.vstack([W, J[list(pinned)]]), np.vstack([w, Jv[list(pinned)]])
        m, k = len(W), forces.shape[1]
        K = np.block([[self._M, -W.T], [W, np.zeros((m, m))]])
        # Least squares: rows of a pinned point may repeat those of joints.
        both = [np.vstack([forces + Q, np.repeat(-w, k, 1)]), np.vstack([Q, -w])]
        driven, free = (np.linalg.lstsq(K, b, rcond=1e-12)[0][: self.n] for b in both)
        return driven, free

    def mobility(self, pinned=()):
        """The mobility (6, 6) of both points, and their accelerations (6,) without wrenches."""
        _, J, Jv = (np.array(m) for m in self.of_points(self.z0, self.v0))
        driven, free = self.solve(self.z0, self.v0, J.T, pinned)
        return J @ (driven - free), (J @ free + Jv).ravel()


def _moving(name):
    """The mechanism of a scene after each of some steps under random wrenches of two users, with
    its equations in absolute coordinates, and the wrenches."""
    linkage, at = shipped(name), SCENES[name]
    block = virtual_mechanism(
        linkage, Mechanism(), Directions(), step_s=1 / 512, felt=True, users=(at,)
    )
    running, rng = Running(block), np.random.default_rng(5)
    for _ in range(12):
        F = {
            port: rng.normal(size=3) * (0.3, 0.3, 0.003)
            for port in ("F_hand", "F_drift", f"{at}.F_hand", f"{at}.F_drift")
        }
        running.set(**F)
        for _ in range(15):
            running.step(1 / 512)
        on = [F["F_hand"] - F["F_drift"], F[f"{at}.F_hand"] - F[f"{at}.F_drift"]]
        found = {k.removeprefix(f"{at}."): v for k, v in running.y.items() if f"{at}." in k}
        y = {k: np.array([running.y[k], v]) for k, v in found.items() if k != "F"}
        peer = Points(linkage, running.state["q"], running.state["qd"])
        yield y, running, peer, np.array(on)


@pytest.mark.parametrize("name", SCENES)
def test_each_point_has_its_mobility_and_what_the_other_does(name):
    """Lambda_k^-1, a_bias, and F_env with the acceleration that the other user's wrench gives."""
    for y, _, peer, on in _moving(name):
        L, bias = peer.mobility()
        near = {"rtol": 1e-7, "atol": 1e-9 * np.abs(L).max()}
        own = L[:3, :3], L[3:, 3:]
        np.testing.assert_allclose(y["x"].ravel(), np.array(peer.of_points(peer.z0, 0)[0]).ravel())
        np.testing.assert_allclose(y["Lambda_inv"], own, **near)
        np.testing.assert_allclose(y["a_bias"].ravel(), bias, rtol=1e-6, atol=1e-7)
        across = L[:3, 3:] @ on[1], L[3:, :3] @ on[0]
        felt = [own[k] @ y["F_env"][k] for k in (0, 1)]
        np.testing.assert_allclose(felt, across, rtol=1e-6, atol=1e-8 * np.abs(L).max())
        assert np.linalg.norm(across) > 0.1


@pytest.mark.parametrize("name", SCENES)
def test_the_joints_constrain_what_no_wrench_moves(name):
    """P_c is the projector on the directions in which the linkage's joints let a point not move,
    whatever both users do: there the accelerations by either one's wrench are zero."""
    found = set()
    for y, _, peer, _ in _moving(name):
        L, _ = peer.mobility()
        S = np.diag([1.0, 1.0, mean_link_length(shipped(name))])
        for k, rows in enumerate((slice(0, 3), slice(3, 6))):
            n = round(float(y["n_constraints"][k]))
            values, vectors = np.linalg.eigh(S @ L[rows, rows] @ S)
            null = vectors[:, :n]
            np.testing.assert_allclose(y["P_c"][k], null @ null.T, atol=1e-6)
            if n == 1 and values[0] < 1e-9 * values[2]:
                moved = y["P_c"][k] @ S @ L[rows, :]
                assert np.abs(moved).max() < 1e-7 * np.abs(S @ L[rows, :]).max()
                found.add(k)
    assert found == {0, 1}


@pytest.mark.parametrize("name", SCENES)
def test_a_point_held_still_pins_the_linkage_for_the_other(name):
    """Where the other user's wrench keeps the other point still, a user's law, Lambda_1^-1 (F_1 +
    F_env), gives the mobility of the linkage with that point pinned to the ground."""
    at = SCENES[name]
    for _, running, peer, on in _moving(name):
        L, _ = peer.mobility()
        pinned, _ = peer.mobility((3, 4, 5))
        holding = -np.linalg.pinv(L[3:, 3:], rcond=1e-9) @ L[3:, :3] @ on[0]
        running.set(**{"F_hand": on[0], f"{at}.F_hand": holding})
        running.set(**{"F_drift": np.zeros(3), f"{at}.F_drift": np.zeros(3)})
        y = running.outputs("Lambda_inv", "F_env")
        felt = y["Lambda_inv"] @ (on[0] + y["F_env"])
        near = {"rtol": 1e-5, "atol": 1e-7 * np.abs(L[:3, :3] @ on[0]).max()}
        np.testing.assert_allclose(felt, pinned[:3, :3] @ on[0], **near)
        np.testing.assert_allclose(np.abs(pinned[3:]).max(), 0.0, atol=1e-8 * np.abs(L).max())


def test_the_graphics_copy_has_the_same():
    """Mobility and constrained directions of both points at the start, from either block."""
    linkage = shipped("two-users")
    parts = Directions(), None
    mechanism = Running(virtual_mechanism(linkage, Mechanism(), *parts, users=("left",)))
    copy = Running(virtual_environment(linkage, GraphicsCopy(), *parts, users=("left",)))
    names = [f"{at}{port}" for at in ("", "left.") for port in ("Lambda_inv", "P_c")]
    ours, theirs = mechanism.outputs(*names), copy.outputs(*names)
    for port in names:
        np.testing.assert_allclose(theirs[port], ours[port], atol=1e-12)


ARMS = (
    "hand.target=[[0.0, 0.035, 0.025, -0.785]]",
    "hands.left.target=[[0.0, 0.024707, -0.011319, 0.314]]",
)


def _monolith(scene, end_s, held=True):
    """x (6,) of both points at end_s where two passive arms hold the linkage itself, integrated as
    one system of differential equations; held: the second one holds on."""
    arms = scene.hand, scene.hands["left"]
    parts = ("mass", "stiffness", "damping", "grip_stiffness", "grip_damping")
    M, K, B, Kg, Bg = (np.concatenate([getattr(a, part) for a in arms]) for part in parts)
    target = np.concatenate([a.target[0][1:] for a in arms])
    q = Running(virtual_mechanism(scene.linkage, Mechanism(), step_s=1 / 512)).state["q"]
    peer = Points(scene.linkage, q, np.zeros(len(q)))
    n, on = peer.n, np.repeat([1.0, float(held)], 3)

    def rates(_t, y):
        z, v, xa, va = np.split(y, [n, 2 * n, 2 * n + 6])
        x, J, _ = (np.array(m) for m in peer.of_points(z, v))
        F = on * (Kg * (xa - x.ravel()) + Bg * (va - J @ v))
        a, _ = peer.solve(z, v, J.T @ F[:, None])
        return np.concatenate([v, a.ravel(), va, (K * (target - xa) - B * va - F) / M])

    x0 = np.array(peer.of_points(peer.z0, 0)[0]).ravel()
    start = np.concatenate([peer.z0, np.zeros(n), x0, np.zeros(6)])
    y = solve_ivp(rates, (0.0, end_s), start, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
    return np.array(peer.of_points(y[:n], 0)[0]).ravel()


def test_the_loop_is_the_linkage_in_two_hands_as_rates_go_up(tmp_path):
    """Points and handles of both users go to those of one continuous system, two passive arms on
    one linkage, to first order: extrapolated to no period, they are where the arms of the
    continuous one are, and not where its first arm alone would be. The energy generated at the
    users' ports goes to zero as the period."""
    end_s, found, energies = 0.5, [], []
    scene = open_scene.load("two-users", ARMS)
    exact, alone = _monolith(scene, end_s), _monolith(scene, end_s, held=False)
    signals = (
        ("virtual_mechanism.x", "virtual_mechanism.left.x"),
        ("haptic_device.x_true", "haptic_device_left.x_true"),
    )
    for rate in (1024, 2048, 4096):
        options = (*ARMS, f"haptics.rate={rate}", f"duration={end_s}", "directions_from=mechanism")
        results = simulate("two-users", tmp_path / str(rate), options).results
        assert results.haptics["time"][-1] == end_s
        rows = [np.concatenate([results.haptics[s][-1] for s in both]) for both in signals]
        found.append(np.array(rows) - exact)
        port = user_port(results)
        assert port
        energies.append(port.generated_J[-1])
    coarse, fine, finest = found
    far = np.abs(fine) > 0.02 * np.abs(fine).max()
    np.testing.assert_allclose((coarse / fine)[far], 2.0, rtol=0.1)
    np.testing.assert_allclose((fine / finest)[far], 2.0, rtol=0.05)
    limit = 2 * finest - fine
    places = [0, 1, 3, 4]  # m
    assert np.abs(limit).max() < 0.06 * np.abs(finest).max()
    assert np.abs(limit[:, places]).max() < 0.01 * np.abs(alone - exact)[places].max()
    assert 0 < energies[2] < 0.55 * energies[1] < 0.3 * energies[0]
