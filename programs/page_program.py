"""A scene as a WebAssembly module behind a page."""

from __future__ import annotations

import tempfile
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from hapticlink.components.component import Component
from hapticlink.fmus.native.compiler import compile_webassembly
from hapticlink.fmus.native.source import component_source, functions, table
from hapticlink.programs import refusals
from hapticlink.programs.build import OPTIONS
from hapticlink.programs.foreign import write_files
from hapticlink.programs.ports import Port, find_fed
from hapticlink.programs.resolve_scene import Resolved
from hapticlink.programs.sources import HERE, Source, add_prefix, write_sources

PAGE = "page.c"
"""What stands in place of the FMU's own file, and includes it."""


@dataclass(frozen=True)
class Drawing:
    """What a page draws: `function` of the signals at `places` (indices in the signal vector)."""

    function: ca.Function
    places: Sequence[int]


def write_page_sources(
    program: Resolved,
    components: Mapping[str, Component],
    ports: Sequence[Port],
    drawing: Drawing,
    offered: Container[str],
) -> dict[str, str]:
    """The C files of the module, whose functions are those of page.c. offered: the parameters,
    `block.name`, that the page may set. Raises InputFault for FMUs of others with resources."""
    reading = (name for name, foreign in program.foreign.items() if foreign.resources)
    reasons = (f"{name} has resources, files that a page lacks" for name in reading)
    refusals.refuse(program.scene.title, reasons)
    blocks = {fmu: _smallest_source(program, offered, fmu, c) for fmu, c in components.items()}
    texts = write_sources(program, blocks, ports)
    texts |= {"program.inc": texts.pop("program.c"), **_picture(drawing)}
    texts[PAGE] = (HERE / PAGE).read_text().replace('"program.c"', '"program.inc"')
    texts["scene.h"] = f'#define GUID ""\n{texts["scene.h"]}'
    return texts


def _smallest_source(
    program: Resolved, offered: Container[str], fmu: str, component: Component
) -> Source:
    """The text of a block that starts with the states that it has in the scene, where they follow
    from parameters alone that the page does not change; outputs on request are read seldom."""
    fed, every = find_fed(program.system, fmu), component.parameters
    changes = [f"{fmu}.{v.name}" in offered or n in fed for v in every for n in v.names]
    by_inputs, by_parameters = (component.initialize.jac_sparsity(0, i) for i in (0, 1))
    state = program.instance(fmu).serialized()  # which ends with them
    start = np.frombuffer(state, offset=len(state) - 8 * sum(v.size for v in component.states))
    if by_inputs.nnz() or any(changes[i] for i in by_parameters.get_col()):
        start = start[:0]
    return component_source(component, 0, start.tolist())


def compile_page(texts: Mapping[str, str], folder: Path) -> bytes:
    """The module of these files, compiled in `folder`. Raises CompilerError."""
    with tempfile.TemporaryDirectory(dir=folder) as name:
        room = Path(name)
        return compile_webassembly(write_files(texts, room), room, OPTIONS)


def _picture(drawing: Drawing) -> dict[str, str]:
    """C files of the function by which a page draws."""
    given = drawing.function.expand()
    text, pieces = functions([given])
    numbers = f"#define N_RAW {given.nnz_in()}\n#define N_DRAWN {given.nnz_out()}\n"
    declared = "void draw_picture(const double *raw, double *drawn);"
    call = (
        f"\nvoid draw_picture(const double *raw, double *drawn) {{\n"
        f"    const double *arguments[{given.sz_arg()}] = {{raw}};\n"
        f"    double *results[{given.sz_res()}] = {{drawn}};\n"
        f"    casadi_int iw[{given.sz_iw() + 1}];\n    double w[{given.sz_w() + 1}];\n"
        f"    {given.name()}(arguments, results, iw, w, 0);\n}}\n"
    )
    places = table("int raw_places", map(str, drawing.places))
    parts = {f"picture_{k:03}.c": piece for k, piece in enumerate(pieces)}
    files = {name: add_prefix(part, "picture") for name, part in parts.items()}
    return {
        **files,
        "picture.c": add_prefix(text, "picture") + call,
        "picture.h": f"{numbers}{places}\n{declared}\n",
    }
