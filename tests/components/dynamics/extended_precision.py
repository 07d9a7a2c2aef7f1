"""The equations of a planar linkage in 60 digits, from the geometry and the masses alone."""

import mpmath as mp
import numpy as np

mp.mp.dps = 60


def numbers(linkage, q, qd, F):
    """All that the equations take, flat: (masses and points, q, qd, F), and how to name them."""
    given = {
        "q": list(q),
        "qd": list(qd),
        "F": list(F),
        "op": linkage.operational_point.at or (0, 0),
    }
    for b in linkage.body:
        given[b.name, "mass"] = [b.mass, b.inertia]
        given[b.name, "center"] = b.center or (0.0, 0.0)
    for j in linkage.joint:
        given[j.name, "at"] = [*(j.at_parent or (0, 0)), *(j.at_child or (0, 0)), j.axis or 0.0]
    for i, loop in enumerate(linkage.loop):
        given["loop", i] = [v for at in loop.at for v in at]
    return {name: [mp.mpf(float(v)) for v in values] for name, values in given.items()}


def disturbed(given, rng, size=2.0**-53):
    """Every number off by up to its last place."""
    return {
        name: [v * (1 + mp.mpf(float(rng.uniform(-size, size)))) for v in values]
        for name, values in given.items()
    }


class Column:
    """A point that rides on a body: (x, y, theta), its Jacobian and its bias acceleration."""

    def __init__(self, origin, angle, J, bias):
        self.origin, self.angle, self.J, self.bias = origin, angle, J, bias

    def at(self, point, qd):
        """The same of a point of the body, given in its frame."""
        c, s = mp.cos(self.angle), mp.sin(self.angle)
        r = c * point[0] - s * point[1], s * point[0] + c * point[1]
        J = [[x - t * r[1], y + t * r[0], t] for x, y, t in self.J]
        spin = sum(t * rate for (_, _, t), rate in zip(self.J, qd, strict=True))
        bias = self.bias[0] - spin**2 * r[0], self.bias[1] - spin**2 * r[1]
        return Column((self.origin[0] + r[0], self.origin[1] + r[1]), self.angle, J, bias)


def bodies(linkage, given):
    """Columns at the bodies' origins, of revolute and prismatic joints."""
    n, qd = len(given["q"]), given["qd"]
    still = [[mp.mpf(0)] * 3 for _ in range(n)]
    found = {"ground": Column((mp.mpf(0), mp.mpf(0)), mp.mpf(0), still, (mp.mpf(0), mp.mpf(0)))}
    for i, joint in enumerate(linkage.joint):
        numbers = given[joint.name, "at"]
        parent = found[joint.parent]
        pivot = parent.at(numbers[:2], qd)
        J = [list(column) for column in pivot.J]
        origin, angle, bias = pivot.origin, pivot.angle, pivot.bias
        spin = sum(t * rate for (_, _, t), rate in zip(parent.J, qd, strict=True))
        if joint.type == "revolute":
            angle += given["q"][i]
            J[i][2] += 1
        else:
            # The point of the parent that is passed moves too: Coriolis.
            direction = parent.angle + numbers[4]
            along = mp.cos(direction), mp.sin(direction)
            slid = given["q"][i]
            moved = parent.at(
                (
                    numbers[0] + slid * mp.cos(numbers[4]),
                    numbers[1] + slid * mp.sin(numbers[4]),
                ),
                qd,
            )
            J = [list(column) for column in moved.J]
            J[i][0] += along[0]
            J[i][1] += along[1]
            origin = moved.origin
            coriolis = 2 * spin * qd[i]
            bias = moved.bias[0] - coriolis * along[1], moved.bias[1] + coriolis * along[0]
        child = Column(origin, angle, J, bias)
        back = [-v for v in numbers[2:4]]
        found[joint.child] = child.at(back, qd)
    return found


def solution(linkage, given):
    """(qdd, lambda, Lambda^-1) of D qdd - W' lambda = J_h' F - C qd, W qdd = -w."""
    n, qd, found = len(given["q"]), given["qd"], bodies(linkage, given)
    D, b = mp.zeros(n), mp.zeros(n, 1)
    for body in linkage.body:
        mass, inertia = given[body.name, "mass"]
        center = found[body.name].at(given[body.name, "center"], qd)
        for i, one in enumerate(center.J):
            b[i] -= mass * (one[0] * center.bias[0] + one[1] * center.bias[1])
            for j, other in enumerate(center.J):
                D[i, j] += mass * (one[0] * other[0] + one[1] * other[1])
                D[i, j] += inertia * one[2] * other[2]
    point = linkage.operational_point
    hand = found[point.body].at(given["op"], qd)
    m = 2 * len(linkage.loop)
    K, right = mp.zeros(n + m), mp.zeros(n + m, 4)
    for i, column in enumerate(hand.J):
        right[i, 0] = b[i] + sum(x * f for x, f in zip(column, given["F"], strict=True))
        for k in range(3):
            right[i, 1 + k] = column[k]
        for j in range(n):
            K[i, j] = D[i, j]
    for r, loop in enumerate(linkage.loop):
        at = given["loop", r]
        one, other = (
            found[name].at(at[2 * k : 2 * k + 2], qd) for k, name in enumerate(loop.bodies)
        )
        for k in range(2):
            right[n + 2 * r + k, 0] = other.bias[k] - one.bias[k]
            for i in range(n):
                K[n + 2 * r + k, i] = one.J[i][k] - other.J[i][k]
                K[i, n + 2 * r + k] = other.J[i][k] - one.J[i][k]
    solved = K**-1 * right
    mobility = [
        [sum(hand.J[i][k] * solved[i, 1 + j] for i in range(n)) for j in range(3)] for k in range(3)
    ]
    numbers = [[solved[i, 0] for i in range(n)], [solved[n + i, 0] for i in range(m)], mobility]
    return [np.array(v, dtype=object) for v in numbers]
