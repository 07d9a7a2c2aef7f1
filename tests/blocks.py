"""A component evaluated by names, for tests."""

import numpy as np


class Running:
    """A component with named inputs, parameters and outputs, started at its defaults."""

    def __init__(self, component, inputs=None, parameters=None):
        self.component = component
        self.u = self._flat(component.inputs, inputs or {})
        self.p = self._flat(component.parameters, parameters or {})
        self.x = np.array(component.initialize(self.u, self.p)).ravel()
        self.t = 0.0

    @staticmethod
    def _flat(variables, values):
        unknown = set(values) - {v.name for v in variables}
        assert not unknown, unknown
        parts = [np.ravel(values.get(v.name, v.starts)) for v in variables]
        return np.concatenate([np.zeros(0), *parts])

    def set(self, **inputs):
        offset = 0
        for v in self.component.inputs:
            if v.name in inputs:
                self.u[offset : offset + v.size] = np.ravel(inputs.pop(v.name))
            offset += v.size
        assert not inputs, inputs

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
        offset = 0
        for v in self.component.states:
            if v.name in states:
                self.x[offset : offset + v.size] = np.ravel(states.pop(v.name))
            offset += v.size
        assert not states, states

    @property
    def y(self):
        flat = np.array(self.component.output(self.x, self.u, self.p, self.t)).ravel()
        return self._named(self.component.outputs, flat)

    def step(self, h):
        for _ in range(self.component.substeps):
            part = h / self.component.substeps
            self.x = np.array(self.component.step(self.x, self.u, self.p, self.t, part)).ravel()
            self.t += part
