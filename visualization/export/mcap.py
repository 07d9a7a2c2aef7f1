"""A run as MCAP, which Foxglove and Rerun open: signals by FMU, energies, and the mechanism.

Messages are Protobuf: JSON has no NaN, and Rerun reads none. Their times are the exact ticks of the
run, rounded to ns.
"""

from __future__ import annotations

import heapq
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hapticlink.analysis.findings.user_port import UserPort, ports, tolerated
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.variables import entry_of
from hapticlink.orchestrator.results.numbers import last_time
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.visualization.export.scene_update import WORLD, SceneDrawing, pose
from hapticlink.visualization.replay.recorded_frames import Recorded

FRAMES_PER_S = 30
"""Of the mechanism, at most; signals have all of their rows."""
Stamped = tuple[int, str, Any]
"""Time (ns), topic and message."""


def write(results: Results, path: Path) -> str:
    """Writes the file; why it is without the mechanism, empty if it has it."""
    from mcap.writer import Writer
    from mcap_protobuf.schema import register_schema

    with atomic_file(path) as unfinished, unfinished.open("wb") as file:
        writer = Writer(file)
        writer.start(library="hapticlink")
        run = json.dumps(results.run, indent=2).encode()
        writer.add_attachment(0, 0, "run.json", "application/json", run)
        messages = _Messages(results)
        channels: dict[str, int] = {}
        for time, topic, message in messages:
            if topic not in channels:
                schema = register_schema(writer, type(message))
                about = messages.about.get(topic, {})
                channels[topic] = writer.register_channel(topic, "protobuf", schema, about)
            writer.add_message(channels[topic], time, message.SerializeToString(), time)
        writer.finish()
    return messages.why


class _Messages:
    """The messages of a run in the order of their times. about: by topic and field, the signal and
    its units; `why` there is no mechanism among the messages until now."""

    def __init__(self, results: Results) -> None:
        self._results, self._units = results, results.record.units
        self._tick = Fraction(results.record.base.removesuffix(" s")) * 10**9
        self._tolerated = tolerated(results)
        self._most = int(FRAMES_PER_S * last_time(results)) + 1
        self._kinds: dict[str, tuple[Any, list[_Field]]] = {}
        self._drawing: SceneDrawing | None = None
        self.about: dict[str, dict[str, str]] = {}
        self.why = ""

    def __iter__(self) -> Iterator[Stamped]:
        for window, port in zip(self._results.windows(), ports(self._results), strict=True):
            streams = [*self._signals(window), self._frames(window, port)]
            if port:
                energies = {"put_in": port.put_in_J, "generated": port.generated_J} | port.blocks_J
                rows = np.column_stack([port.time_s, *energies.values()])
                units = dict.fromkeys(energies, "J")
                streams.append(self._rows("/energy/user_port", "", [*energies], units, rows))
            yield from heapq.merge(*streams, key=itemgetter(0))

    def _signals(self, window: Results) -> Iterator[Iterator[Stamped]]:
        """Of each FMU, the messages of its columns."""
        for table in window.tables.values():
            rows = table.rows[window.within(table["time"])]
            places: dict[str, list[int]] = {}
            for place, column in enumerate(table.columns[1:], 1):
                places.setdefault(column.partition(".")[0], []).append(place)
            for fmu, own in places.items():
                columns = [table.columns[place] for place in own]
                yield self._rows(f"/{fmu}", f"{fmu}.", columns, self._units, rows[:, [0, *own]])

    def _rows(
        self, topic: str, prefix: str, columns: Sequence[str], units: Mapping[str, str],
        rows: Vector,
    ) -> Iterator[Stamped]:  # fmt: skip
        """A message for each row, of a time (s) and columns whose names begin with the prefix."""
        if topic not in self._kinds:
            fields = [*_fields(columns, prefix)]
            self._kinds[topic] = _kind(topic, fields), fields
            self.about[topic] = {
                f.name: f"{f.signal} [{', '.join(units.get(columns[p], '1') for p in f.places)}]"
                for f in fields
            }
        kind, fields = self._kinds[topic]
        for time, row in zip(self._ns(rows[:, 0]), rows, strict=True):
            seconds, *values = row.tolist()
            entries = {
                f.name: [values[p] for p in f.places] if f.repeated else values[f.places[0]]
                for f in fields
            }
            yield time, topic, kind(time=seconds, **entries)

    def _frames(self, window: Results, port: UserPort | None) -> Iterator[Stamped]:
        """The mechanism, and the handles of its users."""
        from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

        try:
            run = Recorded(window, self._most)
        except InputFault as fault:
            self.why = "" if self._drawing else str(fault)
            return
        self.why = ""
        for time, frame in zip(self._ns(run.times), run.frames(port, self._tolerated), strict=True):
            self._drawing = self._drawing or SceneDrawing(run.picture.marks, frame)
            yield time, "/scene/mechanism", self._drawing.update(frame, time)
            for user, seen in {"": frame, **frame.get("others", {})}.items():
                if "handle" in seen:
                    *at, angle = seen["handle"]
                    held = PoseInFrame(frame_id=WORLD, pose=pose(at, 0.0, angle))
                    held.timestamp.FromNanoseconds(time)
                    yield time, f"/scene/handle{user and '_'}{user}", held

    def _ns(self, times: Vector) -> list[int]:
        """Times (s) in ns, of the whole ticks that they are."""
        n, d = self._tick.numerator, self._tick.denominator
        ticks = np.rint(times * 1e9 / float(self._tick)).tolist()
        return [(2 * n * int(tick) + d) // (2 * d) for tick in ticks]


class _Field(NamedTuple):
    """What a message has of a signal: `places` of its columns, those of a matrix row by row."""

    name: str
    signal: str
    places: list[int]
    repeated: bool


def _fields(columns: Sequence[str], prefix: str) -> Iterator[_Field]:
    """The fields of the signals, which are named as these are, without the prefix, and without what
    no identifier has."""
    signals: dict[str, list[tuple[tuple[int, ...], int]]] = {}
    for place, column in enumerate(columns):
        signal, indices = entry_of(column)
        signals.setdefault(signal, []).append((indices, place))
    taken = {"time"}
    for signal, entries in signals.items():
        name = re.sub(r"\W|^(?=\d)", "_", signal.removeprefix(prefix), flags=re.ASCII)
        while name in taken:
            name += "_"
        taken.add(name)
        places = [place for _, place in sorted(entries)]
        yield _Field(name, signal, places, bool(entries[0][0]))


def _kind(topic: str, fields: Sequence[_Field]) -> Any:
    """The class of the messages of a topic: doubles, lists of them for vectors and matrices."""
    from google.protobuf.descriptor_pb2 import FileDescriptorProto
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    name = re.sub(r"\W", "_", topic.removeprefix("/"), flags=re.ASCII)
    file = FileDescriptorProto(name=f"{name}.proto", package="hapticlink", syntax="proto2")
    message = file.message_type.add(name=name)
    for number, field in enumerate([_Field("time", "", [], False), *fields], 1):
        label = "LABEL_REPEATED" if field.repeated else "LABEL_OPTIONAL"
        called = {"name": field.name, "json_name": field.name}
        message.field.add(number=number, type="TYPE_DOUBLE", label=label, **called)
    pool = DescriptorPool()
    pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(f"hapticlink.{name}"))
