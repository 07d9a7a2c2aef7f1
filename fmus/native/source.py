"""The C text of a component, which `fmi2.c` includes as component.h, without the GUID."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence

import casadi as ca

from hapticlink.components.component import Component
from hapticlink.fmus.fmu_functions import RARELY, functions_of_fmu, on_request
from hapticlink.fmus.native.split_functions import split_functions


def component_source(
    component: Component, rarely: int = RARELY, start: Sequence[float] = ()
) -> tuple[str, Iterable[str]]:
    """component.h (sizes, names, start values and functions) and the texts of further C files, with
    pieces of long functions, as `split_functions.split`; the same texts for the same component.
    With `rarely` = 0 outputs on request are never evaluated in a step, and with the states `start`
    these are not computed: the compiler leaves out the functions of either.

    The functions are `static`, so that their names (initialize, output, advance) cause no conflict.
    """
    parts = functions_of_fmu(component)
    text, pieces = functions(parts.functions)
    settable = (*component.inputs, *component.parameters)
    fixed = [False] * len(component.start_inputs)
    fixed += [v.variability == "fixed" for v in component.parameters for _ in v.names]
    starts = (*component.start_inputs, *component.start_parameters)
    names = (name for v in (*settable, *component.outputs) for name in v.names)
    sizes = {
        "N_U": len(component.start_inputs),
        "N_P": len(component.start_parameters),
        "N_Y": sum(v.size for v in component.outputs),
        "N_X": sum(v.size for v in component.states),
        "N_Z": parts.n_shared,
        "SUBSTEPS": component.substeps,
        "SAMPLED": int(component.timing == "sampled"),
        "REDUCED": int(parts.reduced is not None),
        "RARELY": rarely,
        "KNOWN_START": int(bool(start)),
        # Working memory that the functions need to call the look-ups of tables.
        **{f"N_{of.upper()}": _room(text, of) for of in ("arg", "res", "iw", "w")},
    }
    header = "\n".join(
        [
            *(f"#define {name} {value}" for name, value in sizes.items()),
            table("char *const names", map(json.dumps, names)),
            table("char *const state_names", map(json.dumps, component.state_texts)),
            table("double starts", map(number, starts)),
            table("double start_states", map(number, start)),
            table("char is_fixed", (str(int(flag)) for flag in fixed)),
            table("char on_request", (str(int(flag)) for flag in on_request(component))),
            text,
        ]
    )
    return header, pieces


def table(declared: str, entries: Iterable[str]) -> str:
    """A C array with an additional entry of zeros at its end, since a C array must not be empty."""
    rows = [f"    {entry}," for entry in entries]
    zero = "{0}" if any(row.endswith("},") for row in rows) else "0"
    return "\n".join([f"static const {declared}[] = {{", *rows, f"    {zero}}};"])


def number(value: float) -> str:
    if math.isfinite(value):
        return repr(float(value))
    return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"


def _room(text: str, of: str) -> int:
    """The largest size that a function of `text` requests in its `_work`."""
    return max(int(n) for n in re.findall(rf"\*sz_{of} = (\d+);", text))


_FLOOR = """
/* floor, without a call of the C library: many processors have no instruction for it. */
static inline double whole_below(double x) {
    const double whole = 4503599627370496.0; /* 2^52, from which on there are integers alone */
    if (!(fabs(x) < whole)) return x;
    const double nearest = copysign((fabs(x) + whole) - whole, x);
    return nearest - (nearest > x);
}
#define floor whole_below
"""


def functions(given: Iterable[ca.Function]) -> tuple[str, Iterable[str]]:
    """Static C functions in which each instruction of CasADi's virtual machine is a statement on
    local variables, and the C files with the pieces of those that are long.

    CasADi's tests for missing arguments and results are left out, since `fmi2.c` passes all of
    them: with these branches the time to compile grows with the square of the length.
    """
    generator = ca.CodeGenerator("component")
    for function in given:
        generator.add(function if function.is_a("SXFunction") else function.expand())
    text = "#define CASADI_SYMBOL_EXPORT static\n" + generator.dump()
    text = re.sub(r"arg\[\d+\]\? (arg\[\d+\]\[\d+\]) : 0;", r"\1;", text)
    text = re.sub(r"if \(res\[\d+\]!=0\) ", "", text)
    return split_functions(text.replace("#include <math.h>\n", f"#include <math.h>\n{_FLOOR}", 1))
