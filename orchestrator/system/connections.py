"""[[fmu]] and [[connection]] tables against the FMUs themselves, with every fault at its place in
the scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path as FilePath

from hapticlink.orchestrator.base.faults import Finding, InputFault, unknown
from hapticlink.orchestrator.fmi.description import Description, describe
from hapticlink.orchestrator.fmi.start_values import Starts, fitting
from hapticlink.orchestrator.fmi.units import SAME, Linear, conversion
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.records import ForeignFmu, Value, Wire
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path


@dataclass(frozen=True)
class Ends:
    """The two ends of a connection, found; each input carries its conversion."""

    source: str
    source_port: str
    target: str
    target_port: str
    outputs: tuple[Scalar, ...]
    inputs: tuple[Scalar, ...]
    hold: str | None
    entry: int
    """Its place in the scene's list."""


@dataclass
class Wiring:
    """Reads a scene's tables; what is wrong with them gathers in `findings`."""

    scene: Scene
    findings: list[Finding] = field(default_factory=list)

    def _find(self, path: Path, message: str) -> None:
        self.findings.append(self.scene.place(path, message))

    # --- [[fmu]] --------------------------------------------------------------------------

    def fmus(self) -> Iterator[tuple[ForeignFmu, Description, Starts]]:
        """Each FMU that can be used, with its start values."""
        for i, fmu in enumerate(self.scene.fmu):
            try:
                found = describe(FilePath(fmu.path))
            except InputFault as fault:
                self._find(("fmu", i, "path"), str(fault))
                continue
            if fmu.timing:
                found = replace(found, timing=fmu.timing)
            starts = [s for item in fmu.start.items() for s in self._start(i, found, *item)]
            yield fmu, found, tuple(starts)

    def _start(self, i: int, found: Description, name: str, value: Value) -> Starts:
        path: Path = ("fmu", i, "start", name)
        scalars = self._settable(path, found, name, start=True)
        if not scalars:
            return ()
        values = value if isinstance(value, tuple) else (value,)
        if len(values) != len(scalars):
            self._find(path, f"{len(values)} values for the {len(scalars)} of {name}")
            return ()
        try:
            return tuple((s, fitting(s, given)) for s, given in zip(scalars, values, strict=True))
        except ValueError as error:
            self._find(path, str(error))
            return ()

    def _settable(
        self, path: Path, found: Description, name: str, start: bool = False
    ) -> tuple[Scalar, ...]:
        """The entries of `name`, where a value may come in: once, at the `start`, or always."""
        able = attrgetter("startable" if start else "settable")
        named = [s for s in (*found.scalars, *found.strings) if name in (s.name, s.port)]
        scalars = tuple(sorted(filter(able, named), key=lambda s: s.indices))
        if named and not scalars:
            what = named[0].causality
            what = what if named[0].variability != "constant" else f"constant {what}"
            hint = ""
            if start:
                others = (
                    ", ".join(dict.fromkeys(s.port for s in found.scalars if able(s))) or "none"
                )
                hint = (
                    ", and the FMU gives it no start of its own (initial exact or approx); what "
                    f"takes a start: {others}"
                )
            self._find(path, f"{name} cannot be set: its causality is {what}{hint}")
        elif not scalars:
            known = dict.fromkeys(s.port for s in filter(able, (*found.scalars, *found.strings)))
            self._find(path, unknown("input or parameter", name, known))
        return scalars

    # --- [[connection]] -------------------------------------------------------------------

    def ends(self, described: Mapping[str, Description]) -> Iterator[Ends]:
        """The ends of every connection that fits."""
        fed: dict[tuple[str, str], int] = {}
        for i, wire in enumerate(self.scene.connection):
            (giver, output), (taker, entry) = (e.split(".", 1) for e in (wire.from_, wire.to))
            if giver not in described or taker not in described:
                continue  # that FMU cannot be read, which has a finding of its own
            outputs = self._outputs(("connection", i, "from"), described[giver], output)
            inputs = self._settable(("connection", i, "to"), described[taker], entry)
            if not outputs or not inputs:
                continue
            if len(outputs) != len(inputs) or inputs[0].type == "String":
                sizes = f"{wire.from_} has {len(outputs)} numbers, {wire.to} takes {len(inputs)}"
                self._find(("connection", i), f"{sizes}; connect their entries one by one")
                continue
            twice = [s for s in inputs if fed.setdefault((taker, s.name), i) != i]
            if twice:
                first = self.scene.connection[fed[taker, twice[0].name]].from_
                message = f"{taker}.{twice[0].name} is fed by {first} already; keep one"
                self._find(("connection", i, "to"), message)
                continue
            try:
                converted = _converted(wire, described[giver], outputs, described[taker], inputs)
            except ValueError as error:
                self._find(("connection", i), str(error))
                continue
            yield Ends(giver, output, taker, entry, outputs, converted, wire.hold, i)

    def whole(
        self,
        ends: Iterable[Ends],
        ours: Mapping[str, Description],
        rows: Iterable[tuple[str, str]],
    ) -> None:
        """Finds connections to some entries of a vector that the loop's own `rows` feed: they
        take the place of such a row, and the other entries would have no source."""
        sources = {target: source for source, target in rows if source.split(".")[0] in ours}
        ends = tuple(ends)
        fed = {(e.target, s.name) for e in ends for s in e.inputs}
        for e in ends:
            port = e.inputs[0].port
            source = sources.get(f"{e.target}.{port}")
            entries = ours[e.target].port(port, "input") if e.target in ours else ()
            if source and any((e.target, s.name) not in fed for s in entries):
                message = f"the other entries of {port} lose their source, {source}; connect all"
                self._find(("connection", e.entry, "to"), message)

    def _outputs(self, path: Path, found: Description, name: str) -> tuple[Scalar, ...]:
        outputs = found.port(name, "output")
        if not outputs:
            others = [s for s in found.scalars if name in (s.name, s.port)]
            known = dict.fromkeys(s.port for s in found.outputs)
            missing = unknown("output", name, known)
            other = f"{name} is no output, its causality is {others[0].causality}" if others else ""
            self._find(path, other or missing)
        return outputs


def _converted(
    wire: Wire,
    giver: Description,
    outputs: tuple[Scalar, ...],
    taker: Description,
    inputs: tuple[Scalar, ...],
) -> tuple[Scalar, ...]:
    """The inputs with what the connection does to their values. Raises ValueError."""
    found = []
    for a, b in zip(outputs, inputs, strict=True):
        units = SAME
        if wire.convert:
            try:
                units = conversion(giver.unit(a), taker.unit(b), a.relative or b.relative)
            except ValueError as error:
                raise ValueError(
                    f"{a.name} is in {a.unit}, {b.name} in {b.unit}: {error}; connect signals of "
                    "one kind, or say convert = false"
                ) from None
        found.append(replace(b, conversion=Linear(wire.factor, wire.offset).after(units)))
    return tuple(found)
