"""Small components with answers known in closed form."""

import casadi as ca

from hapticlink.components.component import Block, Component, Variable


def spring(name: str = "spring", substeps: int = 1) -> Component:
    """m x'' = F - k x from x(0) = F/k + 1, by semi-implicit Euler; continuous."""
    b = Block(
        inputs=[Variable("F", (), "N", 0.0, "pushing force")],
        parameters=[
            Variable("m", (), "kg", 2.0, "mass", variability="fixed"),
            Variable("k", (), "N/m", 8.0, "stiffness"),
        ],
        states=[Variable("state", (2,), ("m", "m/s"))],
        outputs=[
            Variable("x", (2,), ("m", "m/s"), description="position & velocity"),
            Variable("a", (), "m/s2", description="acceleration"),
            Variable("time", (), "s"),
        ],
    )
    x = b.x["state"]
    a = (b.u["F"] - b.p["k"] * x[0]) / b.p["m"]
    v = x[1] + b.h * a
    return b.component(
        name,
        "mass on a spring",
        "continuous",
        initial={"state": ca.vertcat(b.u["F"] / b.p["k"] + 1, 0)},
        step={"state": ca.vertcat(x[0] + b.h * v, v)},
        output={"x": x, "a": a, "time": b.t},
        substeps=substeps,
        documentation="Semi-implicit Euler.\n\n  v <- v + h a < 1",
    )


def controller() -> Component:
    """y_k = G e_k + s_k + t_k, s the sum of e_k up to the step before; sampled, matrix input."""
    b = Block(
        inputs=[
            Variable("e", (2,), "m"),
            Variable("G", (2, 2), "N/m", (1.0, 2.0, 3.0, 4.0), "gain, row by row"),
        ],
        states=[Variable("sum", (2,), "m")],
        outputs=[Variable("y", (2,), "N"), Variable("total", (2,), "m")],
    )
    e, total = b.u["e"], b.x["sum"]
    return b.component(
        "controller",
        "sampled controller",
        "sampled",
        initial={"sum": ca.SX.zeros(2)},
        step={"sum": total + e},
        output={"y": b.u["G"] @ e + total + b.t, "total": total},
    )


def fragile() -> Component:
    """r <- sqrt(r - u): nan once u exceeds r; n counts the steps."""
    b = Block(
        inputs=[Variable("u")],
        states=[Variable("n"), Variable("r", (2,), start=(4.0, 4.0))],
        outputs=[Variable("y", (2,)), Variable("count")],
    )
    r = b.x["r"]
    return b.component(
        "fragile",
        "fails when told to",
        "continuous",
        initial={"n": ca.SX(0), "r": ca.SX([4.0, 4.0])},
        step={"n": b.x["n"] + 1, "r": ca.vertcat(r[0], ca.sqrt(r[1] - b.u["u"]))},
        output={"y": r, "count": b.x["n"]},
    )


def stateless(name: str = "gain", factor: float = 2.0) -> Component:
    """y = factor u; neither parameters nor states."""
    b = Block(inputs=[Variable("u")], outputs=[Variable("y")])
    return b.component(
        name, "gain", "sampled", initial={}, step={}, output={"y": factor * b.u["u"]}
    )


def source() -> Component:
    """y = t; neither inputs, parameters nor states."""
    b = Block(outputs=[Variable("y", (), "s")])
    return b.component("source", "clock", "continuous", initial={}, step={}, output={"y": b.t})


EVERY = (spring(), controller(), fragile(), stateless(), source())
