"""The files of a Python FMU, as bytes by name.

pythonfmu provides the slave's base class and the binaries. Its FmuBuilder is not used: it needs a
Python file of the model, leaves sys.path and sys.modules changed, and writes files in random order
with dates and a random GUID, whereas the same component has to give the same bytes here.

Each load of an FMU adds its resources/ to sys.path permanently. Therefore the only modules in it
are pythonfmu's own copy, the slave and the one that imports it, whose names contain a hash of the
content.
"""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Mapping
from importlib.metadata import distribution
from pathlib import Path

import casadi as ca

from hapticlink.components.component import Component, Variable
from hapticlink.fmus import model_description
from hapticlink.fmus.description_common import describe_component
from hapticlink.fmus.documentation import PAGE, documentation
from hapticlink.fmus.errors import FmuError, UnsupportedPlatform
from hapticlink.fmus.fmu_functions import RARELY, functions_of_fmu, on_request
from hapticlink.fmus.reference_run import reference_run
from hapticlink.fmus.reproducible_zip import digest, guid_of
from hapticlink.fmus.straight_line import program

PYTHONFMU = Path(str(distribution("pythonfmu").locate_file("pythonfmu")))
"""Not where `import pythonfmu` finds it: after a Python FMU has run in this process, that is the
FMU's own copy, whose folder is gone."""
_MODULE = """import ctypes

from {}_slave import HapticlinkSlave

# pythonfmu 0.7 releases a reference to this dictionary for each instance, without having taken one.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
"""
"""The module that pythonfmu executes again for each instance: a class that it defined would be
another one each time, which is never released (60 kB; what is left is in `python_slave.Short`)."""
_ENGINE = """
from {}_engine import functions

HapticlinkSlave.made_by = staticmethod(functions)
"""


def require_platform() -> None:
    """Raises UnsupportedPlatform if pythonfmu ships no binary for this platform."""
    if sys.platform in ("linux", "win32") and platform.machine().lower() in ("x86_64", "amd64"):
        return
    raise UnsupportedPlatform(
        f"pythonfmu has no binary for {sys.platform} on {platform.machine()}, only for Linux "
        'and Windows on x86-64; take packaging = "native"'
    )


def entries(component: Component, **experiment: float) -> dict[str, bytes]:
    """All files of the FMU; GUID and name of the slave contain a hash of them. experiment: as of
    `describe_component`. Raises FmuError where the component's functions and variables do not
    fit."""
    check_functions(component)
    parts = functions_of_fmu(component)
    texts = {f.name(): f.serialize() for f in parts.functions}
    functions = {
        "resources/functions.casadi.json": json.dumps(texts).encode(),
        "resources/functions.txt": program(parts.functions, component.look_ups).encode(),
    }
    first = len(component.start_inputs) + len(component.start_parameters)
    requested = [first + k for k, is_one in enumerate(on_request(component)) if is_one]
    about: dict[str, object] = {"n_shared": parts.n_shared}
    if parts.reduced:
        about |= {"on_request": requested, "rarely": RARELY}
    return pack_entries(component, functions, about, **experiment)


def pack_entries(
    component: Component,
    functions: Mapping[str, bytes],
    about: Mapping[str, object],
    engine: bytes = b"",
    /,
    **experiment: float,
) -> dict[str, bytes]:
    """As `entries`, with the files that hold the functions, and what the slave needs to know of
    them. engine: the text of a module whose functions replace these."""
    described_as = describe_component(component, **experiment)
    own_equations = not engine
    run = reference_run(component, described_as.step_size) if own_equations else None
    files = {PAGE: documentation(component, run, on_python=True), **functions}
    for path in sorted(PYTHONFMU.glob("*.py")):
        files[f"resources/pythonfmu/{path.name}"] = path.read_bytes()
    for path in sorted((PYTHONFMU / "resources" / "binaries").rglob("*.*")):
        files[f"binaries/{path.parent.name}/{component.name}{path.suffix}"] = path.read_bytes()

    slave = Path(__file__).with_name("python_slave.py").read_bytes()
    about = _about(component) | dict(about)
    module_text = _MODULE + _ENGINE * bool(engine)
    content = {
        **files,
        "slave": slave,
        "engine": engine,
        "module": module_text.encode(),
        "about": json.dumps(about).encode(),
        **model_description.files(described_as, ""),
    }
    whole = digest(content)
    module, guid = f"hapticlink_{whole[:16]}", guid_of(whole)
    files |= {
        **model_description.files(described_as, guid),
        "resources/component.json": json.dumps(about | {"digest": whole, "guid": guid}).encode(),
        f"resources/{module}.py": module_text.replace("{}", module).encode(),
        f"resources/{module}_slave.py": slave,
        "resources/slavemodule.txt": f"{module}\n".encode(),
    }
    return files | ({f"resources/{module}_engine.py": engine} if engine else {})


def check_functions(component: Component) -> None:
    """Raises FmuError if the component's name is no C identifier, a function does not fit the
    declared variables, or a variable is declared twice."""
    if not component.name.isidentifier() or not component.name.isascii():
        raise FmuError(f"`{component.name}` is no C identifier; an FMU is named by one")
    columns = component.inputs, component.parameters, component.states, component.outputs
    u, p, x, y = (sum(v.size for v in column) for column in columns)
    expected = {"initialize": [u, p, x], "step": [x, u, p, 1, 1, x], "output": [x, u, p, 1, y]}
    for role, sizes in expected.items():
        function: ca.Function = getattr(component, role)
        if function.name() != role:
            raise FmuError(f"`{component.name}`: {role} is a function named {function.name()}")
        parts = [function.sparsity_in(i) for i in range(function.n_in())]
        parts += [function.sparsity_out(i) for i in range(function.n_out())]
        if [part.numel() for part in parts] != sizes or not all(s.is_dense() for s in parts):
            raise FmuError(
                f"`{component.name}`: {function} does not fit the declared variables; expected "
                f"dense columns of {sizes[:-1]} to {sizes[-1]}"
            )
    known = _names((*component.inputs, *component.parameters, *component.outputs))
    if len(set(known)) != len(known):
        twice = sorted({name for name in known if known.count(name) > 1})
        raise FmuError(f"`{component.name}`: declared twice: {', '.join(twice)}")
    if component.substeps < 1:
        raise FmuError(f"`{component.name}`: {component.substeps} substeps; take 1 or more")


def _names(variables: tuple[Variable, ...]) -> list[str]:
    return [name for v in variables for name in v.names]


def _about(component: Component) -> dict[str, object]:
    """The data that the slave needs besides the functions."""
    variability = ["tunable"] * len(component.start_inputs)
    variability += [v.variability for v in component.parameters for _ in v.names]
    return {
        "names": _names((*component.inputs, *component.parameters, *component.outputs)),
        "starts": [*component.start_inputs, *component.start_parameters],
        "fixed": [vr for vr, kind in enumerate(variability) if kind == "fixed"],
        "states": component.state_texts,
        "n_inputs": len(component.start_inputs),
        "n_parameters": len(component.start_parameters),
        "n_outputs": sum(v.size for v in component.outputs),
        "n_x": sum(v.size for v in component.states),
        "timing": component.timing,
        "substeps": component.substeps,
    }
