"""Linkages in space that tests use, beside those of the benchmarks: loops with known motions, and a
top."""

import math
from dataclasses import replace

import numpy as np

from benchmarks.mechanisms import bennett, body, bricard, plate
from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Linkage,
    Loop,
    OperationalPoint,
    Spring,
)

__all__ = [
    "BALL_AND_SLIDER",
    "BAR_IN_HAND",
    "DELTA",
    "bennett",
    "bricard",
    "delta",
    "governor",
    "rssr",
    "sarrus",
    "slider_crank",
    "top",
]

BALL_AND_SLIDER = """
[linkage]
operational_point = { body = "bar", at = [0.0, 0.0, 0.3] }
gravity = [0.0, 0.0, 9.81]

[[linkage.body]]
name = "bar"
mass = 1.0
inertia = [0.02, 0.02, 0.001]
center = [0.0, 0.0, 0.2]

[[linkage.body]]
name = "block"
mass = 2.0
inertia = 0.01

[[linkage.joint]]
name = "ball"
type = "spherical"
child = "bar"

[[linkage.joint]]
name = "slide"
type = "prismatic"
child = "block"
axis = [1.0, 2.0, 2.0]
"""
"""The [linkage] of a scene: a bar on a ball, and a block that slides beside it."""

BAR_IN_HAND = """
title = "A bar on a universal joint, in the hand"
duration = 0.25
graphics.rate = 32

[linkage]
operational_point = { body = "bar", at = [0.0, 0.0, 0.1] }

[[linkage.body]]
name = "bar"
mass = 0.3
inertia = 1e-3
center = [0.0, 0.0, 0.05]

[[linkage.joint]]
name = "joint"
type = "universal"
child = "bar"
at_parent = [0.0, 0.0, -0.1]
axis = [1.0, 0.0, 0.0]
second_axis = [0.0, 1.0, 0.0]

[controller]
bias = "full"

[controller.teleoperation]
stiffness = [200.0, 200.0, 200.0]
damping = [20.0, 20.0, 20.0]

[hand]
type = "constant"
wrench = [0.2, -0.1, 0.3]

[device]
extends = "%s"
"""
"""A scene whose device `% NAME` names."""
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def sarrus():
    """Two pairs of plates, the hinges of one along x and of the other along y, carry a table that
    moves along z."""
    length, half, angle = 0.2, 0.1, 0.6
    rise = length * math.sin(angle)
    out = length * math.cos(angle)
    lower_x, lower_y = (0.0, half, 0.0), (half, 0.0, 0.0)
    arms = {
        "x": (X, lower_x, (0.0, out, rise), (0.0, -out, rise)),
        "y": (Y, lower_y, (out, 0.0, rise), (-out, 0.0, rise)),
    }
    bodies, joints = [], []
    for name, (axis, base, first, second) in arms.items():
        bodies += [plate(f"{name}1", first), plate(f"{name}2", second)]
        joints.append(Joint(name=f"{name}1", child=f"{name}1", at_parent=base, axis=axis))
        joints.append(
            Joint(name=f"{name}2", parent=f"{name}1", child=f"{name}2", at_parent=first, axis=axis)
        )
    bodies.append(Body(name="table", mass=0.5, inertia=(0.002, 0.002, 0.004)))
    hinge = {"at_parent": arms["x"][3], "at_child": lower_x}
    joints.append(Joint(name="table", parent="x2", child="table", axis=X, **hinge))
    loop = Loop(bodies=("y2", "table"), at=(arms["y"][3], lower_y), axes=(Y, Y))
    return Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        loop=(loop,),
        operational_point=OperationalPoint(body="table"),
    )


def rssr(closure="spherical"):
    """A crank about z and a rocker about x, coupled by a rod between two balls, which turns idly
    about itself; or by a massless one, a closure."""
    crank, pivot, rocker = (0.1, 0.0, 0.0), (0.3, 0.1, 0.0), (0.0, 0.0, 0.25)
    span = tuple(float(v) for v in np.add(pivot, rocker) - np.array(crank))
    bodies = [plate("crank", crank), plate("rocker", rocker)]
    joints = [
        Joint(name="crank", child="crank", axis=Z),
        Joint(name="rocker", child="rocker", axis=X, at_parent=pivot),
    ]
    point = OperationalPoint(body="rocker", at=rocker)
    if closure == "rod":
        length = float(np.linalg.norm(span))
        loop = Loop(type="rod", bodies=("crank", "rocker"), at=(crank, rocker), length=length)
    else:
        bodies.append(plate("rod", span))
        joints.append(
            Joint(name="rod", type="spherical", parent="crank", child="rod", at_parent=crank)
        )
        loop = Loop(type="spherical", bodies=("rod", "rocker"), at=(span, rocker))
    return Linkage(body=tuple(bodies), joint=tuple(joints), loop=(loop,), operational_point=point)


def slider_crank():
    """The spatial rigid slider-crank mechanism of the IFToMM library: a crank of .08 m about x, a
    rod of .3 m on a ball, and on a universal joint a slider along x. The crank's mass is at its
    middle, the axes of the universal joint are x of the slider and the rod's normal to it, which
    gives the rod the rates (1.92, -.96, .48) rad/s of the start."""
    span = np.array([0.2, -0.1, -0.2])
    along = span / np.linalg.norm(span)
    across = np.cross(X, along)
    bodies = (
        Body(name="crank", mass=0.12, inertia=(1e-4, 1e-5, 1e-4), center=(0.0, 0.0, 0.04)),
        body("rod", 0.5, 4e-3 * np.eye(3) - 3.6e-3 * np.outer(along, along), span / 2),
        Body(name="slider", mass=2.0, inertia=1e-4),
    )
    end = {"parent": "crank", "at_parent": (0.0, 0.0, 0.08)}
    joints = (
        Joint(name="crank", child="crank", at_parent=(0.0, 0.1, 0.12), axis=X),
        Joint(name="slider", type="prismatic", child="slider", at_parent=(0.2, 0.0, 0.0), axis=X),
        Joint(name="rod", type="spherical", child="rod", **end),
    )
    ends = {"bodies": ("rod", "slider"), "at": (tuple(span.tolist()), (0.0, 0.0, 0.0))}
    square = (tuple((across / np.linalg.norm(across)).tolist()), X)
    return Linkage(
        body=bodies,
        joint=joints,
        loop=(Loop(type="universal", **ends, axes=square),),
        gravity=(0.0, 0.0, -9.81),
        operational_point=OperationalPoint(body="slider"),
        start_velocity={"crank": 6.0},
    )


def governor():
    """The stiff flyball governor of the IFToMM library (A05): a shaft about z with two rods of 1 m
    30 degrees below the horizontal, 5 kg at their ends, and a slider on springs to their middles.
    Shaft and rods are .01 m thick, the slider is a cube of .1 m, of 3,000 kg/m3 all."""
    thick, ball = 1e-4, 5.0
    thin = (0.3 / 12 * (1 + thick), 0.3 / 12 * (1 + thick), 0.3 / 6 * thick)
    bodies = [
        Body(name="shaft", mass=0.3, inertia=thin, center=(0.0, 0.0, 0.5)),
        Body(name="slider", mass=3.0, inertia=3.0 * 0.1**2 / 6),
    ]
    slide = {"parent": "shaft", "at_parent": (0.0, 0.0, 0.5), "axis": Z}
    joints = [
        Joint(name="shaft", child="shaft", axis=Z),
        Joint(name="slider", type="prismatic", child="slider", **slide),
    ]
    springs = []
    for name, side in (("right", 1.0), ("left", -1.0)):
        out = np.array([side * math.cos(math.pi / 6), 0.0, -math.sin(math.pi / 6)])
        sideways = np.eye(3) - np.outer(out, out)
        center = (0.3 * 0.5 + ball) / (0.3 + ball)
        apart = 0.3 * (0.5 - center) ** 2 + ball * (1 - center) ** 2
        tensor = thin[2] * np.outer(out, out) + (thin[0] + apart) * sideways
        bodies.append(body(name, 0.3 + ball, tensor, center * out))
        hinge = {"parent": "shaft", "at_parent": (side * 0.05, 0.0, 1.0), "axis": Y}
        joints.append(Joint(name=name, child=name, **hinge))
        at = ((side * 0.05, 0.0, 0.0), tuple((out / 2).tolist()))
        spring = {"length": 0.5, "stiffness": 8e5, "damping": 4e4}
        springs.append(Spring(bodies=("slider", name), at=at, **spring))
    return Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        spring=tuple(springs),
        gravity=(0.0, 0.0, -9.81),
        operational_point=OperationalPoint(body="slider"),
        start_velocity={"shaft": 2 * math.pi},
    )


def top(**changes):
    """A heavy symmetric top on its point, 40 rad/s about its axis, which leans by .5 rad."""
    lean = 0.5
    axis = np.array([math.sin(lean), 0.0, math.cos(lean)])
    along, across, mass, arm = 8e-4, 2e-3, 0.5, 0.06
    tensor = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    spin = tuple((40.0 * axis).tolist())
    linkage = Linkage(
        body=(body("top", mass, tensor, arm * axis),),
        joint=(Joint(name="ball", type="spherical", child="top"),),
        operational_point=OperationalPoint(body="top", at=tuple((0.1 * axis).tolist())),
        gravity=(0.0, 0.0, -9.81),
        start_velocity={"ball": spin},
    )
    return replace(linkage, **changes)


DELTA = {"base": 0.06, "platform": 0.03, "arm": 0.1, "rod": 0.22, "mass": 0.2, "inertia": 4e-4}
"""Radii of the pivots and of the platform's joints, lengths (m), mass of the platform (kg), and
inertia of an arm about its pivot (kg.m2)."""


def delta():
    """Three arms on the ground and a platform that does not turn, coupled by rods without mass:
    of a delta each pair of rods keeps the platform's directions, and is one rod here."""
    bodies = [Body(name="platform", mass=DELTA["mass"], inertia=1e-4)]
    bodies += [Body(name=n, mass=0.0, inertia=1e-4) for n in ("x", "xy")]
    slides = [("x", "ground", "x", X), ("y", "x", "xy", Y), ("z", "xy", "platform", Z)]
    joints = [
        Joint(name=name, type="prismatic", parent=parent, child=child, axis=axis)
        for name, parent, child, axis in slides
    ]
    loops = []
    for k in range(3):
        out = np.array([math.cos(2 * math.pi * k / 3), math.sin(2 * math.pi * k / 3), 0.0])
        axis, arm = np.cross(out, Z), tuple((DELTA["arm"] * out).tolist())
        bodies.append(Body(name=f"arm{k}", mass=0.0, inertia=DELTA["inertia"]))
        pivot = tuple((DELTA["base"] * out).tolist())
        joints.append(
            Joint(name=f"arm{k}", child=f"arm{k}", at_parent=pivot, axis=tuple(axis.tolist()))
        )
        at = tuple((DELTA["platform"] * out).tolist())
        ends = {"bodies": (f"arm{k}", "platform"), "at": (arm, at)}
        loops.append(Loop(type="rod", **ends, length=DELTA["rod"]))
    return Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        loop=tuple(loops),
        operational_point=OperationalPoint(body="platform"),
    )
