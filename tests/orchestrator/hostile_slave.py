"""An FMU of pythonfmu or pythonfmu3 that behaves badly on demand, with the ports of hostile_fmu.c
and the same names of instances: "<place>_<act>_<step>"."""

from pathlib import Path

from tests.little_fmus import python_fmu_of

RAISES = {
    "raise": "raise ValueError('broken')",
    "base": "raise BaseException('broken')",
    "systemexit": "raise SystemExit(0)",
    "keyboard": "raise KeyboardInterrupt",
    "generator": "raise GeneratorExit",
    "memory": "raise MemoryError",
    "nothing": "raise ValueError()",
    "surrogate": "raise ValueError('\\ud800')",
    "silent": "class E(Exception):\n    def __repr__(self): return 'E'\nraise E",
    "deeper": "def f(): f()\nf()",
}
ACTS = RAISES | {
    "nan": "self.y = value = float('nan')",
    "inf": "self.y = value = float('inf')",
    "huge": "self.y = value = 1e308",
    "whole": "value = 10**400",
    "none": "value = None",
    "text": "value = 'x'",
    "less": "value = []",
    "more": "value = [1.0] * 50",
    "root": "os.chdir('/')",
    "gone": "d = tempfile.mkdtemp(dir='/tmp'); os.chdir(d); os.rmdir(d)",
    "upward": "ctypes.CDLL(None).fesetround(0x800)",
    "leave": "os._exit(0)",
    "exit3": "os._exit(3)",
    "abort": "os.abort()",
    "null": "ctypes.string_at(0)",
    "loop": "while True: pass",
    "sleep": "time.sleep(3600)",
    "slow": "time.sleep(.002)",
    "stdout": "os.close(1)",
    "stderr": "os.close(2)",
    "streams": "sys.stdout = sys.stderr = None",
    "locale": "locale.setlocale(locale.LC_ALL, 'de_DE.UTF-8')",
    "deaf": "signal.signal(signal.SIGINT, signal.SIG_IGN)",
    "seterr": "numpy.seterr(all='raise')",
    "recursion": "sys.setrecursionlimit(len(inspect.stack(0)) + 60)",
    "prints": "[print('%0100d' % i) for i in range(1000)]",
    "flood": "[self.log('x' * 1000, enums.Fmi2Status.error) for _ in range(1000)]",
    "long": "self.log('x' * 2**20, enums.Fmi2Status.error)",
    "format": "self.log('%s%s%s%n%n', enums.Fmi2Status.error)",
    "thread": "threading.Thread(target=time.sleep, args=(3600,), daemon=True).start()",
    "child": "os.fork() or time.sleep(3600)",
    "term": "os.kill(os.getpid(), 15)",
    "int": "os.kill(os.getpid(), 2)",
    "umask": "os.umask(0o777)",
    "environ": "os.environ.clear()",
    "warn": "warnings.simplefilter('error')",
    "garbage": "gc.disable()",
    "queue": "self.log_queue.append(7)",
}
_SLAVE = """
import ctypes, gc, inspect, locale, numpy, os, signal, sys, tempfile, threading, time, warnings
from pythonfmu{of} import Fmi{fmi}Causality, Fmi{fmi}Slave, {real}, enums
if {fmi} == 3:
    enums.Fmi2Status = enums.Fmi3Status

class {name}(Fmi{fmi}Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.slope, self.step_count = 0.0, 0.0, 0.0, 0
        self.register_variable({real}("u", causality=Fmi{fmi}Causality.input))
        self.register_variable({real}("y", causality=Fmi{fmi}Causality.output))
        self.register_variable({real}("slope", causality=Fmi{fmi}Causality.output))
        place, act, start = (self.instance_name.split("_") + ["", "0"])[:3]
        self.place, self.act, self.start = place, act, int(start) if start.isdigit() else 0
        self.acts("make", True, True)

    def acts(self, place, value, always=False):
        if place != self.place or not (always or self.step_count >= self.start):
            return value
{acts}
        return value

    def enter_initialization_mode(self):
        self.acts("enter", None, True)

    def exit_initialization_mode(self):
        self.acts("leave", None, True)

    def terminate(self):
        self.acts("end", None)

    def do_step(self, time, size):
        self.step_count += 1
        self.y, self.slope = self.step_count + self.u, self.slope + size / 3.0
        return self.acts("step", True)

    def get_{low}(self, vrs):
        values = [(self.u, self.y, self.slope)[vr] for vr in vrs]
        value = self.acts("get", 0.0)
        return values if value == 0.0 else value if isinstance(value, list) else [value] * len(vrs)

    def set_{low}(self, vrs, values):
        self.u = values[0]
        self.acts("set", None)

    def _get_fmu_state(self):
        return self.acts("save", dict(u=self.u, y=self.y, slope=self.slope, n=self.step_count))

    def _set_fmu_state(self, state):
        self.acts("restore", None)
        self.u, self.y, self.slope = state["u"], state["y"], state["slope"]
        self.step_count = state["n"]
"""


def hostile_slave(folder: Path, fmi: str) -> Path:
    """The FMU, `Hostile2.fmu` or `Hostile3.fmu` in `folder`."""
    acts = ""
    for name, text in ACTS.items():
        body = text.replace("\n", f"\n{12 * ' '}")
        acts += f"        if self.act == {name!r}:\n            {body}\n"
    name, real = f"Hostile{fmi}", {"2": "Real", "3": "Float64"}[fmi]
    of = "" if fmi == "2" else "3"
    text = _SLAVE.format(of=of, fmi=fmi, real=real, low=real.lower(), name=name, acts=acts)
    states = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
    options = states if fmi == "2" else {k.replace("state", "State"): v for k, v in states.items()}
    return python_fmu_of(folder, text, f"{name.lower()}_slave", fmi, **options)
