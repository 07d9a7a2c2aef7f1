"""A scene that runs again and again behind a page: what the page asks for, what it is sent."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import Any

from hapticlink.fmus.durations import record_duration
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.real_time_session import LiveRun
from hapticlink.orchestrator.scene.blocks import driver_of
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system import fmu_files
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.visualization.live_and_standalone import first_messages
from hapticlink.visualization.live_and_standalone.choose_model import MODEL, has_model, with_model
from hapticlink.visualization.live_and_standalone.offered_controls import Settings, target
from hapticlink.visualization.live_and_standalone.viewed_scene import pack_scene, simulated
from hapticlink.visualization.live_page import messages
from hapticlink.visualization.live_page.controls import Controls
from hapticlink.visualization.live_page.frames import FrameReader
from hapticlink.visualization.live_page.server_pipe import Pipe

TURN = 0.0035
"""Time (s) between two looks at the messages while the scene runs, every other tick at 512 Hz."""
WAIT = 0.02
"""Time (s) between two looks at the messages while nothing runs."""


class Building(logging.Handler):
    """Tells the page which block is being built, and what all of them took before (s), if it is
    known."""

    def __init__(self, link: Pipe, took: float | None) -> None:
        super().__init__()
        self._link, self._took = link, took
        fmu_files.LOG.addHandler(self)
        fmu_files.LOG.setLevel(logging.INFO)
        fmu_files.LOG.propagate = False  # the terminal shows the page's address

    def emit(self, record: logging.LogRecord) -> None:
        self._link.send({"type": "building", "said": record.getMessage(), "took": self._took})


class LiveSession:
    """The runs of a scene behind a page. `recordings` get folders `<root>-1`, `<root>-2`, ...

    real_time: `hl.RealTime`, which runs a scene and writes its folder as `hl.run` does. settings:
    those with which the first run begins. paused: whether it waits at its start.
    """

    def __init__(
        self,
        scene: Scene,
        link: Pipe,
        root: Path,
        real_time: Callable[[Scene], Any],
        settings: Settings | None = None,
        paused: bool = False,
    ) -> None:
        self._given, self._link, self._root, self._real_time = scene, link, root, real_time
        self._controls: Controls | None = None
        self._settings = settings or {}
        self._scene = with_model(scene, self._settings.get(MODEL))
        self._state: dict[str, Any] = {"paused": paused, "recording": None, "ended": None}
        self.recordings: list[Path] = []
        self._waiting: list[messages.Message] = []
        self._before = ExitStack()

    def run(self) -> None:
        """Run until Ctrl-C, which raises RunInterrupted or Interrupted, or until the server has
        ended, which raises Fault."""
        scene = self._scene
        self._link.send(first_messages.describe_opening(scene))
        with self._before:  # it ends where the first run begins
            took = self._before.enter_context(record_duration(f"{scene.title}: FMUs of its page"))
            Building(self._link, took)
            self._repeat()

    def _repeat(self) -> None:
        while True:
            out = self._begin()
            live = self._real_time(self._scene)
            self._live, self._controls, self._again = live, None, False
            try:
                result = live.run(self._turn, out, tables=False, every=TURN)
            finally:
                if out and (out / "run.json").exists():
                    self.recordings.append(out)
            if not self._again:
                self._state["recording"] = None
                if result.run["end"]["reason"] != "duration":
                    self._wait(result)

    def _begin(self) -> Path | None:
        """The folder of the run that begins, None where it is not recorded."""
        if not self._state["recording"]:
            return None
        free = (self._root.with_name(f"{self._root.name}-{i}") for i in count(1))
        folder = next(path for path in free if not path.exists())
        self._state["recording"] = str(folder)
        return folder

    def _turn(self, live: LiveRun) -> None:
        if self._controls is None:
            self._start(live)
        assert self._controls
        changed, waiting = False, self._waiting
        self._waiting = []
        for message in messages.newest([*waiting, *self._link.received()]):
            if self._again:  # what comes behind a reset is for the run that begins
                self._waiting.append(message)
                continue
            if isinstance(message, messages.Time):
                self._time(message.do)
                continue
            assert isinstance(message, messages.Hand | messages.SetControl)
            try:
                if isinstance(message, messages.SetControl) and message.key == MODEL:
                    self._choose_model(bool(message.value))
                else:
                    self._controls.apply(message)
            except InputFault as fault:
                self._refuse(message, fault)
            changed = changed or not isinstance(message, messages.Hand)
        if self._again:
            live.stop()
        if changed:
            self._tell_controls()
        self._require_server()
        self._frames.send(live, self._link, self._controls.pulled)

    def _refuse(self, message: messages.Message, fault: InputFault) -> None:
        """Say why; a hold that only a run that begins with it can have begins anew with it."""
        self._say("refused", why=str(fault))
        assert self._controls
        if isinstance(message, messages.SetControl) and self._controls.begins_with(message):
            connection, hold = message.key.removeprefix("holds."), message.value
            self._begin_with(open_scene.load(self._given, {f'holds."{connection}"': hold}))
            self._say("refused", why=f"{hold} begins at t = 0: it runs in Python")
            self._anew(self._state["recording"] and "again")

    def _choose_model(self, wanted: bool) -> None:
        """Begin anew with the hold `model`, or without it, and with the scene's other holds. Raises
        InputFault where no such scene can run; this run goes on then."""
        if wanted == has_model(self._scene):
            return
        how = "with" if wanted else "without"
        self._say("refused", why=f"{how} the hold model the run begins at t = 0, once it is built")
        with build_system(with_model(self._given, wanted)):
            pass
        for key in [key for key in self._settings if key.startswith("holds.")]:
            del self._settings[key]
        self._settings[MODEL] = wanted
        self._begin_with(self._given)
        self._anew(self._state["recording"] and "again")

    def _begin_with(self, given: Scene) -> None:
        """Run another scene from the next start on, with the hold that is chosen."""
        self._given, self._scene = given, with_model(given, self._settings.get(MODEL))

    def _start(self, live: LiveRun) -> None:
        self._before.close()
        self._frames, self._controls = FrameReader(live), Controls(live, self._settings)
        if whys := self._controls.restore():
            self._say("refused", why="; ".join(whys))
        scene = self._scene
        at = self._frames.handles(live)
        self._held = {target(user): at[user] for user in at if not driver_of(scene, user)}
        self._packed, self._packed_given = (
            pack_scene(simulated(each)) for each in (scene, self._given)
        )
        self._link.send(first_messages.describe_viewed_run(scene, live.system, live.energies()))
        self._tell_controls()
        if self._state["paused"]:
            live.pause()
        self._tell(ended=None)

    def _time(self, do: str) -> None:
        match do:
            case "pause":
                self._live.pause()
                self._tell(paused=True)
            case "resume":
                self._live.resume()
                self._tell(paused=False)
            case "step":
                self._live.step()
                self._tell(paused=True)
            case "reset":
                self._anew(self._state["recording"] and "again")
            case "record":
                self._anew(None if self._state["recording"] else "new")

    def _anew(self, recording: str | None) -> None:
        """Begin a run at t = 0 once the messages are read that came with this one."""
        self._state["recording"], self._again = recording, True

    def _wait(self, result: Any) -> None:
        """Say how a run has ended by itself, and wait for a reset or recording. What is changed
        meanwhile waits for the run that begins then."""
        reason = result.run["end"]["reason"]
        self._tell(ended=str(result.fault or f"the run has ended: {reason}"), recording=None)
        while True:
            interrupt.raise_if_interrupted()
            self._require_server()
            received = self._link.received()
            self._waiting += [m for m in received if not isinstance(m, messages.Time)]
            for message in received:
                if isinstance(message, messages.Time) and message.do in ("reset", "record"):
                    self._state["recording"] = "new" if message.do == "record" else None
                    return
            time.sleep(WAIT)

    def _require_server(self) -> None:
        if not self._link.alive:
            raise Fault("the page's server has ended: start `hapticlink view` again")

    def _tell_controls(self) -> None:
        assert self._controls
        self._say("controls", controls=self._controls.described())
        parameters = self._controls.parameters() | self._held
        about = {"scene": self._packed, "given": self._packed_given, "settings": self._settings}
        self._say("settings", **about, parameters=parameters)

    def _tell(self, **state: Any) -> None:
        self._state |= state
        self._say("state", **self._state)

    def _say(self, kind: str, **content: Any) -> None:
        self._link.send({"type": kind} | content)
