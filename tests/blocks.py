"""A component evaluated by names, for tests."""

from functools import wraps

import casadi as ca
import numpy as np

from hapticlink.components.blocks import virtual_environment as environment_block
from hapticlink.components.blocks import virtual_mechanism as mechanism_block
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Mechanism


def once(build):
    """`build`, whose component is built once for the same arguments: it has no state."""
    components = {}

    @wraps(build)
    def built(*arguments, **named):
        key = repr((arguments, named))
        if key not in components:
            components[key] = build(*arguments, **named)
        return components[key]

    return built


virtual_mechanism = once(mechanism_block.virtual_mechanism)
virtual_environment = once(environment_block.virtual_environment)


class Running:
    """A component with named inputs, parameters and outputs, started at its defaults."""

    def __init__(self, component, inputs=None, parameters=None):
        self.component = component
        self.u = self._flat(component.inputs, inputs or {})
        self.p = self._flat(component.parameters, parameters or {})
        self.x = np.array(component.initialize(self.u, self.p)).ravel()
        self.t = 0.0
        self._step = on_own_memory(component.step)
        self._substep = on_own_memory(component.substep or component.step)
        self._outputs = {}

    @staticmethod
    def _flat(variables, values):
        unknown = set(values) - {v.name for v in variables}
        assert not unknown, unknown
        parts = [np.ravel(values.get(v.name, v.starts)) for v in variables]
        return np.concatenate([np.zeros(0), *parts])

    def set(self, **inputs):
        """Sets inputs, and returns the block."""
        return self._write(self.component.inputs, self.u, inputs)

    def _write(self, variables, flat, values):
        offset = 0
        for v in variables:
            if v.name in values:
                flat[offset : offset + v.size] = np.ravel(values.pop(v.name))
            offset += v.size
        assert not values, values
        return self

    def _named(self, variables, flat):
        named, offset = {}, 0
        for v in variables:
            part = flat[offset : offset + v.size]
            named[v.name] = part.reshape(v.shape) if v.shape else float(part[0])
            offset += v.size
        return named

    @property
    def state(self):
        return self._named(self.component.states, self.x)

    def put(self, **states):
        """Replaces states, and returns the block."""
        return self._write(self.component.states, self.x, states)

    @property
    def y(self):
        return self.outputs(*(v.name for v in self.component.outputs))

    def outputs(self, *names):
        """The outputs `names`, with nothing evaluated that only others need."""
        variables = [v for v in self.component.outputs if v.name in names]
        assert len(variables) == len(names), names
        if names not in self._outputs:
            self._outputs[names] = on_own_memory(self._output(variables))
        return self._named(variables, self._outputs[names](self.x, self.u, self.p, self.t))

    def _output(self, variables):
        whole, declared = self.component.output, self.component.outputs
        if len(variables) == len(declared):
            return whole
        rows = np.flatnonzero([v in variables for v in declared for _ in v.names])
        arguments = whole.sx_in()
        return ca.Function("y", arguments, [whole(*arguments)[rows.tolist()]])

    def step(self, h):
        n = self.component.substeps
        for k in range(n):
            part, step = h / n, self._step if k == n - 1 else self._substep
            self.x = step(self.x, self.u, self.p, self.t, part)
            self.t += part


def running(linkage, contacts=None, directions=None, *, step_s=1e-3, frame_s=None, **mechanism):
    """The mechanism of a linkage; it detects its contacts itself, if these do not say otherwise."""
    if contacts is not None:
        contacts = Contacts(**({"detection": "haptics"} | contacts))
    settings, places = Mechanism(**mechanism), {"step_s": step_s, "frame_s": frame_s}
    return Running(virtual_mechanism(linkage, settings, directions, contacts, **places))


def advance(block, t_end, rate=500):
    """`block` after steps at a rate (Hz) over t_end."""
    for _ in range(round(t_end * rate)):
        block.step(1 / rate)
    return block


def state_after(block, rate, t_end):
    """The coordinates and velocities after these steps."""
    state = advance(block, t_end, rate).state
    return np.concatenate([state["q"], state["qd"]])


RATES = (500, 1000, 2000, 4000)


def errors(start, exact, t_end, rates=RATES, of=slice(None)):
    """The largest error of the coordinates and velocities `of` the block that `start` begins anew,
    at t_end, with steps at each of the rates."""
    return [np.abs((state_after(start(), rate, t_end) - exact)[of]).max() for rate in rates]


def order(errors, rates=RATES):
    """By how much log error falls with log rate: the observed order of a method."""
    return -np.polyfit(np.log(rates), np.log(errors), 1)[0]


def on_own_memory(function):
    """`function` of flat arrays, as a call that costs no conversion."""
    arguments = [np.zeros(function.numel_in(i)) for i in range(function.n_in())]
    result = np.zeros(function.numel_out(0))
    buffer, evaluate = function.buffer()
    for i, argument in enumerate(arguments):
        buffer.set_arg(i, memoryview(argument))
    buffer.set_res(0, memoryview(result))

    def call(*values, _buffer=buffer):  # `evaluate` holds a bare pointer to it
        for argument, value in zip(arguments, values, strict=True):
            argument[:] = value
        evaluate()
        return result.copy()

    return call
