"""The slave of every Python FMU: a component's functions behind pythonfmu's interface.

Its text is copied into the FMU's resources/ under a name with a hash of the FMU's content: all
Python FMUs of a process share one interpreter, in which a second module of the same name would
silently be the first one. It needs the standard library and pythonfmu, and uses casadi if that is
installed.

All reals are in one array [inputs | parameters | outputs], whose indices are the value references.

    continuous   doStep: substeps - 1 times x <- substep(x, u, p, t, h/substeps), then
                 x, y, z <- advance(...), with the outputs at the end of the step;
                 get: that y, or y = output(x, u, p, t) if values were set since
    sampled      doStep: x, y <- advance(...), with the outputs at t_k, and further substeps;
                 get: that y

z are values for the next step that the outputs have evaluated already (`fmus.one_pass`); they are
no state: where p, x or t are not those that they were evaluated for, they are evaluated again.

Where outputs of a plant are left out while nobody reads them (`Variable.on_request`), `reduced`
takes the place of `advance`: after `rarely` steps without a read of them, or if there were as many
between the last two. When they are read again, y = output(x, u, p, t), with the same bits.

Until the end of initialisation mode a get of either kind returns y = output(x0, u, p, t) with
x0 = initialize(u, p), from the values set so far.

A call out of order (FMI 2.0.5 section 4.2.4), a time that is not finite, and a step that does not
begin where the last one ended, goes back or nowhere, or beyond the stop time, are refused.
"""

from __future__ import annotations

import array
import atexit
import ctypes
import functools
import json
import math
import os
import sys
import typing

from pythonfmu import Fmi2Slave, enums

MODES = ("instantiated", "in initialisation mode", "initialised", "terminated")
INSTANTIATED, INITIALIZATION, STEP, TERMINATED = MODES
NEAR = 1e-3
"""Share of a step by which its begin and end may be off."""


def _surviving(method: typing.Callable) -> typing.Callable:
    """A method whose exceptions do not crash the process.

    pythonfmu 0.7 reports an exception as fmi2Fatal and releases its references to the class, the
    instance and its log, and then releases them again when it frees the instance, which crashes
    the process. So an additional reference to each is added here.
    """

    @functools.wraps(method)
    def surviving(self: HapticlinkSlave, *arguments: typing.Any) -> typing.Any:
        try:
            return method(self, *arguments)
        except Exception:
            for referenced in (type(self), self, self.log_queue):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(referenced))
            raise

    return surviving


class _Named:
    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


class Short(type(Fmi2Slave)):  # type: ignore[misc]
    """Shows pythonfmu 0.7 the two texts that it looks for in the order of a class's bases: for each
    instance it keeps a list of these and a copy of the text of each for ever, 0.6 kB otherwise."""

    _shown = (_Named(""), _Named("<class 'pythonfmu.Fmi2Slave'>"))
    __mro__ = property(lambda cls: cls._shown)


class HapticlinkSlave(Fmi2Slave, metaclass=Short):
    _loaded: typing.ClassVar[dict] = {}
    """Functions by way of evaluation, read once for all instances."""
    _released: typing.ClassVar[list] = []
    made_by: typing.ClassVar[typing.Callable | None] = None
    """Gives the functions of an instance from its resources/, where a physics engine has them."""

    def __init__(self, **kwargs: typing.Any) -> None:
        super().__init__(**kwargs)
        self._release_at_exit()
        with open(os.path.join(self.resources, "component.json"), encoding="utf-8") as file:
            self._about = about = json.load(file)
        self._require_own_description()
        n_u, n_p, n_y, n_x = (about[k] for k in ("n_inputs", "n_parameters", "n_outputs", "n_x"))
        self._settable, self._n_inputs = n_u + n_p, n_u
        self._fixed = frozenset(about["fixed"])
        self._sampled, self._substeps = about["timing"] == "sampled", about["substeps"]
        self._whole = 0 if self._sampled else self._substeps - 1  # the substep with the outputs
        # due: to be computed before the next read
        self._mode, self._start_due, self._output_due = INSTANTIATED, True, True
        # References of outputs on request; whether the last step left them out; steps since they
        # were read, and between the two reads before.
        self._on_request = frozenset(about.get("on_request", ()))
        self._rarely = about.get("rarely", math.inf)
        self._left_out, self._unread, self._unread_before = False, 0, 0
        self._stop = math.inf
        self._shared_time = math.nan  # for which z was evaluated; nan: it is out of date
        t, h = _doubles([0.0]), _doubles([0.0])
        x, trial, after = (_doubles([0.0] * n_x) for _ in range(3))
        # A sampled block's outputs, before they are known to be finite.
        new_y = _doubles([0.0] * n_y)
        end, z, next_z = _doubles([0.0]), *(_doubles([0.0] * about["n_shared"]) for _ in range(2))
        self._shared, self._next_shared = z, next_z
        values = _doubles(about["starts"] + [0.0] * n_y)
        u, p, y = values[:n_u], values[n_u : n_u + n_p], values[n_u + n_p :]
        self._time, self._substep, self._values, self._outputs = t, h, values, y
        self._state, self._trial, self._after = x, trial, after
        self._new_outputs, self._end = new_y if self._sampled else y, end
        self._buffers: list = []
        self._blocks: dict = {}
        self._engine = self.made_by(self.resources) if self.made_by else None
        self._evaluate_x0 = self._bind("initialize", (u, p), x)
        self._evaluate_y = self._bind("output", (x, u, p, t), y, z)
        whole = self._bind("advance", (trial, u, p, t, h, end, z), after, self._new_outputs, next_z)
        part = self._bind("substep", (trial, u, p, t, h), after) if self._substeps > 1 else whole
        parts = [part] * self._whole, [part] * (self._substeps - 1 - self._whole)
        self._evaluate = self._evaluate_less = [*parts[0], whole, *parts[1]]
        if self._on_request:
            arguments = (trial, u, p, t, h, end, z)
            less = self._bind("reduced", arguments, after, self._new_outputs, next_z)
            self._evaluate_less = [*parts[0], less, *parts[1]]

    def _require_own_description(self) -> None:
        """pythonfmu passes on no GUID; importers take the one that stands in the FMU's folder."""
        path = os.path.join(os.path.dirname(self.resources), "modelDescription.xml")
        guid = self._about["guid"]
        if os.path.exists(path):
            with open(path, encoding="utf-8") as file:
                if f'guid="{guid}"' not in file.read():
                    raise ValueError(f"the guid of {path} is not that of this FMU, {guid}")

    def _release_at_exit(self) -> None:
        """Makes pythonfmu's library release its interpreter before the library's destructors run.

        pythonfmu 0.7 destroys the static object that holds the interpreter and then releases it
        again in the library's destructor, which corrupts memory as the process ends. If it is
        released while Python is still running, it is null by then. In a process that is no Python
        program the library owns the interpreter, and nothing is to be done.
        """
        if os.name != "posix" or self._released or not getattr(sys, "orig_argv", None):
            return
        folder = os.path.join(os.path.dirname(self.resources), "binaries", "linux64")
        try:
            for name in os.listdir(folder):
                path = os.path.join(folder, name)
                library = ctypes.CDLL(path, mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
                atexit.register(library.finalizePythonInterpreter)
                self._released.append(library)
        except OSError:  # loaded from elsewhere: nothing to release
            return

    # --- the component's functions ------------------------------------------------------

    def _bind(self, name: str, arguments: tuple, *results: memoryview) -> typing.Callable:
        """A function without arguments that evaluates `name` on these arrays in place."""
        function = self._functions()[name]
        if not hasattr(function, "buffer"):
            return functools.partial(function, *arguments, *results)
        buffer, evaluate = function.buffer()
        for i, argument in enumerate(arguments):
            buffer.set_arg(i, argument)
        for i, result in enumerate(results):
            buffer.set_res(i, result)
        self._buffers.append(buffer)  # `evaluate` holds a bare pointer to it
        return evaluate

    def _functions(self) -> dict:
        if self._engine is not None:
            return self._engine
        pure = os.environ.get("HAPTICLINK_PURE_PYTHON") == "1"
        if pure not in self._loaded:
            self._loaded[pure] = self._read_text() if pure else self._read_casadi()
        return self._loaded[pure]

    def _read_casadi(self) -> dict:
        """The CasADi functions, or those in plain Python if casadi is missing or cannot read its
        files."""
        try:
            import casadi

            with open(os.path.join(self.resources, "functions.casadi.json")) as file:
                texts = json.load(file)
            return {name: casadi.Function.deserialize(text) for name, text in texts.items()}
        except Exception as error:
            self.log(f"runs on plain Python, which is slower than casadi: {error}")
            return self._read_text()

    def _read_text(self) -> dict:
        path = os.path.join(self.resources, "functions.txt")
        with open(path, encoding="utf-8") as file:
            namespace = {"__name__": "functions"}
            exec(compile(file.read(), path, "exec"), namespace)
        return namespace

    # --- FMI ----------------------------------------------------------------------------

    def _require(self, call: str, *allowed: str) -> None:
        if self._mode not in allowed:
            raise ValueError(f"{call} may not be called: the FMU is {self._mode}")

    @_surviving
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        self._require("fmi2SetupExperiment", INSTANTIATED)
        if not math.isfinite(start_time):
            raise ValueError(f"the start time is {start_time}")
        self._time[0] = start_time
        self._stop = math.inf if stop_time is None else stop_time

    @_surviving
    def enter_initialization_mode(self) -> None:
        self._require("fmi2EnterInitializationMode", INSTANTIATED)
        self._mode = INITIALIZATION

    @_surviving
    def exit_initialization_mode(self) -> None:
        self._require("fmi2ExitInitializationMode", INITIALIZATION)
        self._refresh()
        if not all(map(math.isfinite, self._state)):
            raise ValueError(self._not_finite(self._state, self._time[0]))
        self._mode = STEP

    @_surviving
    def terminate(self) -> None:
        self._require("fmi2Terminate", STEP)
        self._mode = TERMINATED

    @_surviving
    def get_real(self, vrs: list) -> list:
        block, last, on_request = self._block(vrs)
        if last >= self._settable:
            if on_request:
                self._unread_before = self._unread or self._unread_before
                self._unread = 0
                self._output_due = self._output_due or self._left_out
            if self._output_due:
                self._refresh()
        values = self._values
        return values[block].tolist() if block else [values[vr] for vr in vrs]

    @_surviving
    def set_real(self, vrs: list, values: list) -> None:
        if self._mode == TERMINATED:
            self._require("fmi2SetReal", STEP)
        block, last, _ = self._block(vrs)
        if last >= self._n_inputs:
            self._refuse_unsettable(vrs)
        if block:
            self._values[block] = array.array("d", values)
        else:
            for vr, value in zip(vrs, values):  # noqa: B905 - pythonfmu sends pairs
                self._values[vr] = value
        if self._mode != STEP:
            self._start_due = True
        if self._mode != STEP or not self._sampled:
            self._output_due = True
        if last >= self._n_inputs:
            self._shared_time = math.nan

    def _block(self, vrs: list) -> tuple:
        """The value references as a slice, None if they are not consecutive, the largest one, and
        whether some are of outputs on request; cached. Raises ValueError for an unknown value
        reference."""
        key = tuple(vrs)
        found = self._blocks.get(key)
        if found is None:
            last = max(key, default=-1)
            # pythonfmu passes those of more than 31 bits as negative numbers.
            if wrong := [vr for vr in key if not 0 <= vr < len(self._values)]:
                message = f"unknown value reference {wrong[0] % 2**32}"
                raise ValueError(f"{message}; {len(self._values)} are known")
            run = key == tuple(range(last + 1 - len(key), last + 1))
            block = slice(last + 1 - len(key), last + 1) if run else None
            found = block, last, not self._on_request.isdisjoint(key)
            if len(self._blocks) >= 1000:
                self._blocks.clear()
            self._blocks[key] = found
        return found

    def _refuse_unsettable(self, vrs: list) -> None:
        for vr in vrs:
            name = self._about["names"][vr]
            if vr >= self._settable:
                raise ValueError(f"{name} is an output; it cannot be set")
            if self._mode == STEP and vr in self._fixed:
                raise ValueError(
                    f"parameter {name} is fixed; set it before the end of initialisation mode"
                )

    def _refresh(self) -> None:
        """Update x0 and y after values were set."""
        if self._start_due:
            self._evaluate_x0()
            self._start_due = False
        if self._output_due:
            self._evaluate_y()
            self._output_due = self._left_out = False
            self._shared_time = self._time[0]

    def do_step(self, current_time: float, step_size: float) -> bool:
        """True is fmi2OK, False fmi2Discard; raises nothing. State and outputs change only on
        success."""
        now = self._time[0]
        try:
            return self._advance(current_time, step_size)
        except Exception as error:
            self._time[0] = now
            self.log(f"step at t = {current_time!r}: {error!r}", enums.Fmi2Status.error)
            return False

    def _advance(self, start: float, step_size: float) -> bool:
        self._require("fmi2DoStep", STEP)
        self._require_step(start, step_size)
        time, x, trial, after = self._time, self._state, self._trial, self._after
        if self._start_due:
            self._refresh()
        if self._shared and self._shared_time != start:
            time[0] = start
            self._evaluate_y()
        # Until the step is accepted, a plant's outputs are to be evaluated again.
        self._output_due, self._shared_time = not self._sampled, math.nan
        less = max(self._unread, self._unread_before) >= self._rarely
        n = self._substeps
        self._substep[0], self._end[0] = step_size / n, start + step_size
        trial[:] = x
        for k, evaluate in enumerate(self._evaluate_less if less else self._evaluate):
            time[0] = start + k * step_size / n
            evaluate()
            trial[:] = after
        time[0] = start
        if not all(map(math.isfinite, trial)):
            message = self._not_finite(trial, start + step_size)
            self.log(f"{message}; the state stays at t = {start!r}", enums.Fmi2Status.error)
            return False
        if self._sampled:
            if not all(map(math.isfinite, self._new_outputs)):
                message = self._not_finite(self._new_outputs, start, outputs=True)
                text = f"{message}; state and outputs stay as before the step"
                self.log(text, enums.Fmi2Status.error)
                return False
            self._outputs[:] = self._new_outputs
        x[:], self._shared[:] = trial, self._next_shared
        time[0] = self._shared_time = start + step_size
        self._output_due, self._left_out = False, less
        self._unread += 1
        return True

    def _require_step(self, start: float, step_size: float) -> None:
        """Raises ValueError for a step that does not begin where the FMU stands and end later, at
        the stop time at most. Steps whose times are added up are off by less than NEAR of one."""
        end, near, now = start + step_size, NEAR * step_size, self._time[0]
        if not step_size > 0.0 or not math.isfinite(end):
            raise ValueError(f"a step from t = {start!r} by {step_size!r} s has no end after it")
        if not abs(start - now) <= near:
            raise ValueError(f"a step from t = {start!r} s: the FMU stands at {now!r} s")
        if end > self._stop + near:
            raise ValueError(f"a step to t = {end!r} s, beyond the stop time {self._stop!r} s")

    def _not_finite(self, values: memoryview, time: float, outputs: bool = False) -> str:
        """The message which state, or with `outputs` which output, is not finite, with the likely
        cause."""
        about = self._about
        names = about["names"][self._settable :] if outputs else about["states"]
        i = next(i for i, value in enumerate(values) if not math.isfinite(value))
        known = zip(about["names"], self._values[: self._settable])  # noqa: B905 - outputs left out
        bad = [f"{name} = {value}" for name, value in known if not math.isfinite(value)]
        cause = (
            f"not finite before: {', '.join(bad[:3])}; look at what sets it"
            if bad
            else "inputs and parameters are finite; look for an input that is 0 and divides"
            if outputs
            else "inputs and parameters are finite; take a smaller step or more substeps"
        )
        return f"{names[i]} became {values[i]} at t = {time!r}; {cause}"

    # --- FMU state: bytes, so that saving and serialising are the same, bit for bit -------

    def _get_fmu_state(self) -> bytes:
        # A plant's outputs follow from the rest, also where an importer has changed the bytes.
        if self._left_out:
            self._output_due = True
            self._refresh()
        output_due = self._output_due or not self._sampled
        flags = bytes((MODES.index(self._mode), self._start_due, output_due))
        parts = (self._time, self._values, self._state)
        return self._about["digest"].encode() + flags + b"".join(p.tobytes() for p in parts)

    @_surviving
    def _set_fmu_state(self, state: bytes) -> None:
        digest, parts = self._about["digest"].encode(), (self._time, self._values, self._state)
        offset = len(digest) + 3
        if not state.startswith(digest) or len(state) != offset + sum(p.nbytes for p in parts):
            raise ValueError("this FMU state was not saved by this FMU")
        flags = state[len(digest) : offset]
        if flags[0] >= len(MODES):
            raise ValueError("this FMU state is damaged")
        self._mode, self._start_due, self._output_due = MODES[flags[0]], *map(bool, flags[1:])
        self._shared_time, self._left_out = math.nan, False
        for part in parts:
            end = offset + 8 * len(part)
            part[:] = array.array("d", state[offset:end])
            offset = end

    # There are no variables of these types, but importers may call these functions.
    get_integer = _surviving(Fmi2Slave.get_integer)
    get_boolean = _surviving(Fmi2Slave.get_boolean)
    get_string = _surviving(Fmi2Slave.get_string)
    set_integer = _surviving(Fmi2Slave.set_integer)
    set_boolean = _surviving(Fmi2Slave.set_boolean)
    set_string = _surviving(Fmi2Slave.set_string)

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return bytes(state)


def _doubles(values: list) -> typing.Any:
    """An array of doubles, whose slices share its memory."""
    return memoryview(array.array("d", values))
