"""What an FMU says of itself: ports (scalars grouped into vectors and matrices) and timing."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

from fmpy import read_model_description

from hapticlink.components.component import Timing  # the contract's word, a plain Literal
from hapticlink.orchestrator.faults import InputFault

Type = Literal["Real", "Integer", "Boolean"]
TYPES: tuple[Type, ...] = ("Real", "Integer", "Boolean")


@dataclass(frozen=True)
class Scalar:
    """One FMI variable."""

    name: str
    reference: int
    type: Type
    causality: str
    unit: str | None

    @property
    def port(self) -> str:
        """`x` of `x[1]`: the vector or matrix that the scalar is an entry of."""
        return self.name.partition("[")[0]


@dataclass(frozen=True)
class Description:
    """A co-simulation FMU, as its modelDescription.xml says."""

    path: Path
    guid: str
    identifier: str
    timing: Timing
    scalars: tuple[Scalar, ...]

    def port(self, name: str, *causalities: str) -> tuple[Scalar, ...]:
        """The entries of vector `name` (or the scalar of that very name), in order."""
        return tuple(
            s for s in self.scalars if name in (s.port, s.name) and s.causality in causalities
        )

    @property
    def outputs(self) -> tuple[Scalar, ...]:
        """All outputs, reals before integers before booleans."""
        found = [s for s in self.scalars if s.causality == "output"]
        return tuple(sorted(found, key=lambda s: TYPES.index(s.type)))


def describe(path: Path) -> Description:
    """Raises InputFault where the file is no FMI 2.0 co-simulation FMU."""
    try:
        model = read_model_description(str(path), validate=False)
        with zipfile.ZipFile(path) as archive:
            tree = ElementTree.fromstring(archive.read("modelDescription.xml"))
    except Exception as error:  # FMPy raises bare Exception for what it cannot read
        raise InputFault(f"{path}: not a readable FMU: {error}") from error
    if model.fmiVersion != "2.0" or model.coSimulation is None:
        raise InputFault(
            f"{path}: FMI {model.fmiVersion}, co-simulation: {model.coSimulation is not None}; "
            "an FMI 2.0 co-simulation FMU is needed"
        )
    block = tree.find("./VendorAnnotations/Tool[@name='hapticlink']/Block")
    sampled = block is not None and block.get("timing") == "sampled"
    scalars = tuple(
        Scalar(v.name, v.valueReference, v.type, v.causality or "local", v.unit)
        for v in model.modelVariables
        if v.type in TYPES
    )
    timing: Timing = "sampled" if sampled else "continuous"
    return Description(path, model.guid, model.coSimulation.modelIdentifier, timing, scalars)
