"""The C files of the interface of FMI 3.0 over that of FMI 2.0."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from hapticlink.fmus.native.compiler import HEADERS
from hapticlink.fmus.scalar_variables import ScalarVariable, arrays

FMI3 = Path(__file__).with_name("fmi3.c")
HEADERS_3 = ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h")


def fmi3_sources(variables: Sequence[ScalarVariable]) -> dict[str, str]:
    """By name: fmi3.c, the headers of the standard, and fmi3_rest.h with the sizes of the variables
    by value reference, 0 where none begins, time the last, all scalars in order, and the functions
    that it has not."""
    files = {name: (HEADERS / name).read_text(errors="replace") for name in HEADERS_3}
    files[FMI3.name] = FMI3.read_text()
    sizes = [n for a in arrays(variables) for n in (len(a.entries), *[0] * (len(a.entries) - 1))]
    tables = {"sizes": [*sizes, 1], "scalars": range(len(sizes) + 1)}
    rest = [
        f"#define N_SCALARS {len(sizes)}",
        *(
            f"static const unsigned {n}[] = {{{', '.join(map(str, t))}}};"
            for n, t in tables.items()
        ),
    ]
    types = re.findall(r"typedef (fmi3\w+) (\w+)TYPE\s*\((.*?)\);", files[HEADERS_3[1]], re.S)
    for returned, name, parameters in types:
        if re.search(rf"\b{name}\b", files[FMI3.name]):
            continue
        result = "lacks(instance, __func__)"
        if returned == "fmi3Instance":
            own = "{.environment = instanceEnvironment, .log = logMessage}"
            result = f"lacks(&(Instance){own}, __func__), NULL"
        elif "nValueReferences" in parameters:
            result = f"nValueReferences ? {result} : fmi3OK"
        rest.append(f"{returned} {name}({parameters}) {{ return {result}; }}")
    return files | {"fmi3_rest.h": "\n".join(rest) + "\n"}
