"""The parts of the virtual mechanism, for its schematic (the report's figures 3.2, 3.5 and B.3)."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.components.component import Block
from hapticlink.components.contact.kept_sides import NAME
from hapticlink.components.dynamics import grasp
from hapticlink.components.dynamics.local_model import SYMBOLS
from hapticlink.components.dynamics.variables import (
    directions_part,
    mobility_part,
    operational_point,
)
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.linkage import Linkage, Mechanism

_EFFORTS = (".F_hand", ".F_drift", ".effort")
"""How the inputs end by which others than the operational point's hand act on the linkage."""


class MechanismParts:
    """The parts, in the order of their evaluation. alpha: by which default Baumgarte's alpha comes
    about, in words; "" if the scene gives it."""

    def __init__(self, block: Block, linkage: Linkage, mechanism: Mechanism, alpha: str) -> None:
        self._block, self._linkage, self._mechanism, self._alpha = block, linkage, mechanism, alpha
        self._outputs = [v.name for v in block.outputs]
        self._held = "D" in block.u
        self._stabilised = "beta" in block.p
        closing = ("W", "w") if linkage.closed else ()
        self._matrices = ("D", *(() if self._held else ("C_qd",)), *closing, "J_h")
        self._others = tuple(name for name in block.u if name.endswith(_EFFORTS))
        self._pushes = tuple(
            f for f, there in (("Q", self._forces()), ("Q_c", self._touching)) if there
        )

    @property
    def _touching(self) -> tuple[str, ...]:
        kinds = (
            ("contacts", "contact_gap" in self._outputs),
            ("joint limits", self._linkage.limited),
        )
        return tuple(name for name, there in kinds if there)

    def _forces(self) -> list[str]:
        """The kinds of forces that the linkage has."""
        linkage = self._linkage
        kinds = {
            "gravity": linkage.gravity is not None,
            "springs": linkage.sprung,
            "friction": linkage.rubbing > 0,
            "drives": linkage.driven,
            "own forces": bool(linkage.force),
        }
        return [name for name, there in kinds.items() if there]

    def _ending(self, *names: str) -> tuple[str, ...]:
        """The outputs of these names, of the operational point and of further ones."""
        return tuple(o for o in self._outputs if o.rsplit(".", 1)[-1] in names)

    def __iter__(self) -> Iterator[BlockPart]:
        yield self._terms()
        x = self._block.x
        if kinds := self._forces():
            states = tuple(name for name in ("deflection",) if name in x)
            text = ", ".join(kinds)
            yield BlockPart(
                "forces of the linkage", text, "g of (2.3)", ("q", "qd"), ("Q", *states)
            )
        if self._touching:
            yield from self._contacts()
        if self._stabilised:
            law = r"$w_{stab} = w + 2 \alpha \beta \dot{h} + \alpha^2 h$"
            reads = ("w", "h", *(name for name in ("alpha", "beta") if name in self._block.p))
            text = f"{law}\n{self._alpha}" if self._alpha else law
            yield BlockPart("Baumgarte stabilisation", text, "(3.5), fig. 3.5", reads, ("w_stab",))
        yield from self._motion()
        yield operational_point(self._ending("x", "v", "position", "velocity"))
        if grasp.POINT in self._block.p:
            yield grasp.part(self._block)
        law = r"$\Lambda^{-1} F_{env} = J_h \ddot{q}$ of the others"
        reads = (*self._pushes, *self._others)
        if "F_env" in self._outputs:
            yield BlockPart("wrench of others", law, "section 4.2.2", reads, ("F_env",))
        if further := tuple(o for o in self._ending("F_env") if o != "F_env"):
            reads = (*reads, "F_hand", "F_drift")
            yield BlockPart("wrench of others, further points", law, "", reads, further)
        if mobilities := self._ending("Lambda_inv"):
            held = tuple(name for name in self._matrices if self._held)
            yield mobility_part(mobilities, held or ("q",))
            found = (
                *self._ending("P_c", "n_constraints"),
                *(n for n in x if n.endswith("n_constrained")),
            )
            yield directions_part(mobilities, found)
        if found := self._ending("rank", "condition"):
            yield BlockPart(
                "diagnostics", r"rank and condition of $W D^{-1} W^T$", "", ("D", "W"), found
            )

    def _terms(self) -> BlockPart:
        """The terms of the equations at the mechanism's own pose."""
        gaps = ("h", "closure_error") if self._linkage.closed else ()
        energy = () if self._touching else ("energy",)
        if self._held:
            law = r"$h(q),\ \dot{h},\ E$" if gaps else r"$E(q, \dot{q})$"
            return BlockPart("own pose", law, "fig. B.3", ("q", "qd"), (*gaps, *energy))
        law = r"$D(q),\ C \dot{q},\ J_h$" + (
            "\n" r"$h(q),\ W,\ w = \dot{W} \dot{q}$" if gaps else ""
        )
        source = "(2.3), (3.2), App. A" if gaps else "(2.3)"
        return BlockPart("linkage", law, source, ("q", "qd"), (*self._matrices, *gaps, *energy))

    def _contacts(self) -> Iterator[BlockPart]:
        x, u = self._block.x, self._block.u
        states = tuple(name for name in ("contact_deflection", NAME) if name in x)
        geometry = tuple(name for name in ("contacts",) if name in u)
        gives = ("Q_c", *self._ending("contact_gap"), *states)
        text = r"$\sum J_i^T F_i$ of" f"\n{' and '.join(self._touching)}"
        yield BlockPart("contact forces", text, "(B.1)", ("q", "qd", *geometry), gives)
        yield BlockPart("energy", r"$E = T + V$", "", ("q", "qd", *geometry), ("energy",))

    def _motion(self) -> Iterator[BlockPart]:
        """The equations of motion, and their integration."""
        acts = (*self._matrices, *self._pushes, "F_hand", "F_drift", *self._others)
        put_out = self._ending("qdd", "lambda", "a_bias")
        if self._stabilised:
            stable = tuple("w_stab" if name == "w" else name for name in acts)
            yield BlockPart("equations of motion", *self._law("w_{stab}"), stable, ("a",))
            law = r"$\ddot{q},\ \lambda$ of $W \ddot{q} + w = 0$"
            outputs = BlockPart("put out, unstabilised", law, "(3.1)", acts, put_out)
            acceleration = "a"
        else:
            yield BlockPart("equations of motion", *self._law("w"), acts, put_out)
            outputs, acceleration = None, "qdd"
        projected = self._linkage.closed and self._mechanism.stabilization == "projection"
        free = ("q_free", "qd_free") if projected else ("q", "qd")
        counters = self._block.x.keys() & {*self._outputs} - {"q", "qd"}
        steps = f"\n{self._mechanism.substeps} substeps" * (self._mechanism.substeps > 1)
        text, gives = f"{self._mechanism.integrator}{steps}", (*free, *sorted(counters))
        yield BlockPart("integrator", text, "fig. 3.2", (acceleration, "q", "qd"), gives)
        if projected:
            law = r"$q - A h,\ \dot{q} - A W \dot{q}$" "\n" r"$A = D^{-1} W^T (W D^{-1} W^T)^{-1}$"
            yield BlockPart("projection", law, "in place of (3.3)", free, ("q", "qd"))
        if outputs:
            yield outputs

    def _law(self, w: str) -> tuple[str, str]:
        """The equation of the accelerations, with its source."""
        D, W, w_held, J = (SYMBOLS[n] if self._held else n for n in ("D", "W", "w", "J_h"))
        w = w.replace("w", w_held, 1)
        velocity = "" if self._held else r" + C \dot{q}"
        forces = f"{J}^T (F_h - F_{{drift}})" + "".join(f" + {name}" for name in self._pushes)
        if self._others:
            forces += r" + \sum J_k^T F_k"
        if not self._linkage.closed:
            return rf"${D} \ddot{{q}}{velocity} = {forces}$", "(B.15)" if self._held else "(2.3)"
        text = (
            rf"${D} \ddot{{q}}{velocity} = {forces}$"
            "\n"
            rf"$+ {W}^T \lambda,\ \ {W} \ddot{{q}} + {w} = 0$"
        )
        if self._held:
            return text, "(B.15), (B.17)"
        return text, "(B.6)" if self._stabilised else "(2.3), (3.1)"
