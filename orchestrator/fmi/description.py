"""The description of an FMU: its ports (scalars grouped into vectors and matrices), their meaning,
and its timing."""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from fmpy import platform, platform_tuple, read_model_description, sharedLibraryExtension

from hapticlink.components.ports import Gradient, Kind, Power, SpringPorts
from hapticlink.orchestrator.base.errors import SHOWN, InputFault
from hapticlink.orchestrator.fmi import annotation, clocks
from hapticlink.orchestrator.fmi.archive import open_archive, read_xml, require_whole
from hapticlink.orchestrator.fmi.model_structure import check_structure
from hapticlink.orchestrator.fmi.units import Unit
from hapticlink.orchestrator.fmi.variables import (
    TYPES,
    WRITTEN,
    Scalar,
    derivatives,
    differences,
    names_of,
    numbers,
    require_countable,
    require_unique,
    texts,
)

if TYPE_CHECKING:  # a word of the contract, whose module loads casadi
    from hapticlink.components.component import Timing

VARIABLE_STEP = "canHandleVariableCommunicationStepSize"
NEEDS_TOOL = "needsExecutionTool"
STATE = {"2": "canGetAndSetFMUstate", "3": "canGetAndSetFMUState"}
SERIALISED = "canSerializeFMUstate"
"""As FMI 2.0 calls it."""
ONCE = "canBeInstantiatedOnlyOncePerProcess"
"""FMI 2.0.5 section 4.3.1, FMI 3.0 section 4.3.1."""
NEEDED = "an FMU of FMI 2.0 or 3.0 for co-simulation or model exchange is needed"
PLATFORMS = {"2": platform, "3": platform_tuple}
"""The folder of this platform in binaries/, by FMI version."""


INTERFACES = {"co-simulation": "CoSimulation", "model-exchange": "ModelExchange"}
"""The elements of modelDescription.xml by the name of the interface, the preferred one first."""
TOLERANCE = 1e-5
"""Relative, of a solver for an FMU that states none; FMPy's."""


@dataclass(frozen=True)
class Equations:
    """What a model-exchange FMU has in the place of a solver.

    states: the names of its continuous states. indicators: the number of its event indicators.
    completes: whether it is told of each step of the solver (`completedIntegratorStep`)."""

    states: tuple[str, ...]
    indicators: int
    completes: bool


@dataclass(frozen=True)
class Description:
    """An FMU by one of its interfaces, as its modelDescription.xml describes it."""

    path: Path
    guid: str
    identifier: str
    timing: Timing
    scalars: tuple[Scalar, ...]
    fmi: str = "2"
    """The major version: "2" or "3"."""
    units: dict[str, Unit] = field(default_factory=dict)
    flags: frozenset[str] = frozenset()
    """The capabilities of the element of its interface that are true."""
    step_size: str | None = None
    """Of its default experiment (s), as it is written."""
    tolerance: float | None = None
    """The relative tolerance that its solver is told: of its default experiment, or the scene."""
    dependencies: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """By output: the variables that it depends on directly. An output that is not here may depend
    on every input."""
    initial_dependencies: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """The same in initialisation mode, where parameters count too (InitialUnknowns)."""
    strings: tuple[Scalar, ...] = ()
    """Variables that are text or binary; of a system, those that are not connected."""
    derivatives: Mapping[str, str] = field(default_factory=dict)
    """By output: the output that is its derivative with respect to time."""
    kinds: Mapping[str, Kind] = field(default_factory=dict)
    power: Mapping[str, Power] = field(default_factory=dict)
    gradients: Mapping[str, Gradient] = field(default_factory=dict)
    springs: tuple[SpringPorts, ...] = ()
    """What the FMU declares of its ports, by port (`annotation`)."""
    states: tuple[str, ...] | None = None
    """The states that its serialised FMU state ends with; None where that is not declared."""
    declares_timing: bool = False
    """Whether the FMU itself declares its timing."""
    clocks: tuple[clocks.FmiClock, ...] = ()
    block: str | None = None
    """The block of this project that it was built from; None for FMUs of others."""
    equations: Equations | None = None
    """Of one for model exchange; None for co-simulation."""

    @property
    def solver(self) -> str:
        """What integrates its equations here, as text; "" for co-simulation."""
        if (of := self.equations) is None:
            return ""
        sizes = f"states: {len(of.states)}, event indicators: {of.indicators}"
        return f"integrated by CVODE, relative tolerance {self.tolerance or TOLERANCE:g}, {sizes}"

    @property
    def has_event_mode(self) -> bool:
        """Whether its importer may handle its events (FMI 3.0 section 4.3.1)."""
        return self.fmi == "3" and "hasEventMode" in self.flags

    @property
    def varies_step(self) -> bool:
        return VARIABLE_STEP in self.flags

    @property
    def restores_state(self) -> bool:
        return STATE[self.fmi] in self.flags

    @property
    def gives_directional_derivatives(self) -> bool:
        return f"providesDirectionalDerivative{'s' * (self.fmi == '3')}" in self.flags

    def port(self, name: str, *causalities: str) -> tuple[Scalar, ...]:
        """The entries of the vector `name` (or the scalar of exactly that name), sorted by index:
        some tools write x[10] before x[2]."""
        return tuple(s for s in self._entries.get(name, ()) if s.causality in causalities)

    @cached_property
    def _entries(self) -> dict[str, list[Scalar]]:
        """The scalars by the names under which `port` finds them, sorted by index."""
        entries: dict[str, list[Scalar]] = {}
        for s in sorted(self.scalars, key=lambda s: s.indices):
            for name in {s.port, s.name}:
                entries.setdefault(name, []).append(s)
        return entries

    def follows(self, output: Scalar, inputs: Iterable[Scalar] | None = None) -> bool:
        """Whether an output depends directly on one of `inputs`, by default on any input."""
        if inputs is None:
            inputs = (s for s in self.scalars if s.causality == "input")
        declared = self.dependencies.get(output.name, self.dependencies.get(output.port))
        return declared is None or any(s.name in declared or s.port in declared for s in inputs)

    def follows_at_start(self, output: Scalar, inputs: Sequence[Scalar]) -> bool:
        """Whether an output depends on one of `inputs`, all inputs or all parameters, in
        initialisation mode. Of an output that is none of the InitialUnknowns only `dependencies`
        are known, which leave parameters out."""
        declared = self.initial_dependencies
        names = declared.get(output.name, declared.get(output.port))
        if names is None:
            return inputs[0].causality != "input" or self.follows(output, inputs)
        return any(s.name in names or s.port in names for s in inputs)

    def group_at_start(
        self, brought: Sequence[Sequence[Scalar]]
    ) -> Mapping[tuple[int, ...], list[int]]:
        """The outputs, by their index, by the connections on which they depend in initialisation
        mode: by index among those that bring these inputs each."""
        key = tuple(tuple(s.name for s in inputs) for inputs in brought)
        if key not in self._groups_at_start:
            found = self._groups_at_start[key] = {}
            for i, output in enumerate(self.outputs):
                on = (
                    k for k, inputs in enumerate(brought) if self.follows_at_start(output, inputs)
                )
                found.setdefault(tuple(on), []).append(i)
        return self._groups_at_start[key]

    @cached_property
    def _groups_at_start(
        self,
    ) -> dict[tuple[tuple[str, ...], ...], dict[tuple[int, ...], list[int]]]:
        """What was found so far: it takes a third of an initialisation."""
        return {}

    def derivative(self, outputs: Iterable[Scalar]) -> tuple[Scalar, ...] | None:
        """The outputs that are the derivatives of `outputs`, all or none."""
        return self._related(outputs, self.derivatives)

    def integral(self, outputs: Iterable[Scalar]) -> tuple[Scalar, ...] | None:
        """The outputs of which `outputs` are the derivatives, all or none."""
        return self._related(outputs, {rate: name for name, rate in self.derivatives.items()})

    def gradient(self, outputs: Sequence[Scalar]) -> tuple[Scalar, ...] | None:
        """The outputs at which the gradient of a whole port is taken, and that gradient; None where
        none is declared."""
        port = outputs[0].port
        for name, declared in self.gradients.items():
            if declared.of == port and tuple(outputs) == self.port(port, "output"):
                return self.port(declared.at, "output") + self.port(name, "output")
        return None

    def _related(
        self, outputs: Iterable[Scalar], names: Mapping[str, str]
    ) -> tuple[Scalar, ...] | None:
        by_name = {s.name: s for s in self.outputs}
        related = [by_name.get(names.get(s.name, "")) for s in outputs]
        return None if None in related else tuple(s for s in related if s)

    def unit(self, scalar: Scalar) -> Unit | None:
        return None if scalar.unit is None else self.units.get(scalar.unit, Unit(scalar.unit))

    @cached_property
    def outputs(self) -> tuple[Scalar, ...]:
        """What is read: all outputs, and what a scene records besides, type by type in the order of
        TYPES."""
        outputs = [s for s in self.scalars if s.causality == "output" or s.recorded]
        return tuple(sorted(outputs, key=lambda s: TYPES.index(s.type)))


def describe(
    path: Path, sizes: Mapping[str, int] = MappingProxyType({}), interface: str | None = None
) -> Description:
    """The FMU, its arrays of the sizes that structural parameters have with the values of `sizes`
    (FMI 3.0 section 2.4.7.5.1), by an interface, the first that it has of INTERFACES by default.
    Raises InputFault where the file is no FMU of FMI 2.0 or 3.0 that can run here."""
    with open_archive(path, "FMU") as archive:
        content = read_xml(archive, "modelDescription.xml")
        tree = ElementTree.fromstring(content)
        version = _version(path, tree)
        element = _find_interface(path, tree, interface)
        if sizes:
            content = _set_sizes(tree, sizes)
        try:
            check_structure(tree, version)
            model = read_model_description(_only_xml(content), validate=False)
            variables = _variables(tree, model, version, resized=bool(sizes))
            ticking = tuple(clocks.read_clocks(tree))
        except Exception as error:  # FMPy raises bare Exception for what it cannot read
            raise InputFault(f"{path}: modelDescription.xml cannot be used: {error}") from error
        identifier = element.get("modelIdentifier", "")
        _require_binary(archive, identifier, version)
        require_whole(archive)
    try:
        declared = annotation.read_annotation(tree, variables["scalars"], variables["units"])
    except ValueError as error:
        raise InputFault(f"{path}: its hapticlink annotation cannot be used: {error}") from error
    capable = {k for k, value in element.items() if value == "true"}
    equations = _read_equations(model) if element.tag == "ModelExchange" else None
    if equations:
        # Its directional derivatives are those of an instant, not over a step.
        capable = {c for c in capable if "DirectionalDerivative" not in c} | {VARIABLE_STEP}
    elif ticking and "hasEventMode" not in capable:
        raise InputFault(
            f"{path}: it has clocks ({ticking[0].name}) and no event mode, in which alone they are "
            "active: FMI 3.0 asks for hasEventMode (section 4.4)"
        )
    return Description(
        path=path,
        guid=model.guid,
        identifier=identifier,
        fmi=version,
        flags=frozenset(capable),
        step_size=model.defaultExperiment and model.defaultExperiment.stepSize,
        tolerance=_read_tolerance(model.defaultExperiment),
        clocks=ticking,
        equations=equations,
        block=None if annotation.block(tree) is None else model.modelName,
        **variables,
        **declared,
    )


def _version(path: Path, tree: ElementTree.Element) -> str:
    """ "2" or "3". Raises InputFault for other versions."""
    version = tree.get("fmiVersion") or "none"
    if version.partition(".")[0] not in ("2", "3"):
        raise InputFault(f"{path}: it is of FMI {version}: {NEEDED}; export it again")
    if not re.fullmatch(r"\d+(\.\d+)*", version):  # 3.0-beta.2
        raise InputFault(
            f"{path}: it is of FMI {version}, a draft of the standard, whose functions have "
            f"changed since: {NEEDED}; export it again with a newer tool"
        )
    return version[0]


def _find_interface(
    path: Path, tree: ElementTree.Element, interface: str | None
) -> ElementTree.Element:
    """The element of the interface that is taken. Raises InputFault where there is none."""
    there = {
        name: found for name, tag in INTERFACES.items() if (found := tree.find(tag)) is not None
    }
    if not there and tree.find("ScheduledExecution") is not None:
        raise InputFault(
            f"{path}: it is for scheduled execution only, where a scheduler activates its model "
            "partitions and preempts them; a run takes steps: export it for co-simulation"
        )
    if not there:
        what = " or ".join(f"<{tag}>" for tag in INTERFACES.values())
        raise InputFault(f"{path}: it is without {what}: {NEEDED}; export it again")
    if interface and interface not in there:
        raise InputFault(
            f"{path}: it is for {' and '.join(there)} only, not for {interface}: leave `interface` "
            "out, or export it again"
        )
    return there[interface] if interface else next(iter(there.values()))


def _read_equations(model: Any) -> Equations:
    states = (d.variable.derivative or d.variable for d in model.derivatives)
    names = tuple(name for state in states for name in names_of(state))
    completes = model.modelExchange.needsCompletedIntegratorStep
    return Equations(names, model.numberOfEventIndicators, completes)


def _set_sizes(tree: ElementTree.Element, sizes: Mapping[str, int]) -> bytes:
    """The XML text with the start values `sizes` of structural parameters."""
    for variable in tree.iterfind("./ModelVariables/*"):
        if (name := variable.get("name", "")) in sizes:
            variable.set("start", str(sizes[name]))
    return ElementTree.tostring(tree)


def _variables(
    tree: ElementTree.Element, model: Any, version: str, *, resized: bool
) -> dict[str, Any]:
    """What ModelVariables, UnitDefinitions and ModelStructure say, as in `Description`."""
    require_countable(model)
    relative, bounded = differences(tree), annotation.block(tree) is not None
    numbered = [
        s
        for v in model.modelVariables
        for s in numbers(v, version, v.name in relative, bounded=bounded, resized=resized)
    ]
    scalars = annotation.with_units(tree, numbered)
    strings = tuple(s for v in model.modelVariables if v.type in WRITTEN for s in texts(v))
    require_unique(s.name for s in (*scalars, *strings))
    return {
        "scalars": scalars,
        "strings": strings,
        "units": {u.name: u for u in map(Unit.read, tree.iterfind("UnitDefinitions/Unit"))},
        "derivatives": derivatives(model),
        "dependencies": _read_dependencies(model.outputs),
        "initial_dependencies": _read_dependencies(model.initialUnknowns),
    }


def _read_dependencies(unknowns: Iterable[Any]) -> dict[str, frozenset[str]]:
    """By variable those that it depends on, where that is declared."""
    return {
        unknown.variable.name: frozenset(v.name for v in unknown.dependencies)
        for unknown in unknowns
        if unknown.dependencies is not None
    }


def _read_tolerance(experiment: Any) -> float | None:
    """The tolerance of a default experiment, None where it is no positive number."""
    with suppress(TypeError, ValueError):
        if experiment and 0.0 < (tolerance := float(experiment.tolerance)) < math.inf:
            return tolerance
    return None


def _only_xml(text: bytes) -> BytesIO:
    """An archive with modelDescription.xml alone, since FMPy reads an archive or a file."""
    file = BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        # By a record, which has a date of its own: a zip file holds none before 1980.
        archive.writestr(zipfile.ZipInfo("modelDescription.xml"), text)
    return file


def _require_binary(archive: zipfile.ZipFile, identifier: str, fmi: str) -> None:
    if not identifier or Path(identifier).name != identifier or "\\" in identifier:
        raise InputFault(
            f"{archive.filename}: its modelIdentifier {identifier!r} is no name of a library; "
            "FMI has it be an identifier of C"
        )
    here = PLATFORMS[fmi]
    wanted = f"binaries/{here}/{identifier}{sharedLibraryExtension}"
    if wanted in archive.NameToInfo:
        return
    parts = (name.split("/") for name in archive.namelist() if name.startswith("binaries/"))
    every = [(p[1], p[2]) for p in parts if len(p) > 2 and p[2]]
    if named := sorted({name for platform, name in every if platform == here}):
        raise InputFault(
            f"{archive.filename}: its modelIdentifier is {identifier!r}, and binaries/{here} has "
            f"{', '.join(named[:SHOWN])}, not {Path(wanted).name}: rename the one or the other"
        )
    there = sorted({platform for platform, _ in every})
    raise InputFault(
        f"{archive.filename}: no binary for this platform ({wanted}), only for "
        f"{', '.join(there) or 'none'}; take an FMU that was built for {here}"
    )
