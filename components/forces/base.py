"""The base class of forces that a scene selects in [[linkage.force]]."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel


@dataclass(frozen=True, kw_only=True)
class Force(ABC):
    """An entry of [[linkage.force]]: its fields are the keys of that table, its methods the
    equations. `type` is its name in `FORCES`; `name` is the prefix of its parameters' names."""

    type: str
    name: str

    def parameters(self) -> list[Variable]:
        """Its parameters in the FMU, such as `<name>.stiffness`; none by default."""
        return []

    @abstractmethod
    def efforts(self, model: LinkageModel) -> ca.SX:
        """Generalised forces, n x 1, in q, qd, t and the parameters `model.p`."""

    def energy(self, model: LinkageModel) -> ca.SX:
        """Potential energy (J); 0 by default."""
        return ca.SX(0)
