"""The table of the package's holds. A hold is a row here and two functions in C: `push_<push>`
takes a sample, `value_<value>` gives the value (orchestrator/run/compiled/).

The build of the package runs this file: it needs no other.
"""

from __future__ import annotations

from typing import NamedTuple


class HoldRow(NamedTuple):
    """What is declared of a hold in C; the other names are those of `Hold`.

    depth: the newest samples that `push_samples` keeps, up to the entries of `stamps` in loop.h.
    remembers: how many vectors of the signal's size the hold keeps besides.
    """

    push: str
    value: str
    depth: int = 1
    remembers: int = 0
    needs: str | None = None
    gives_samples: bool = False
    degree: int | None = 0
    interpolates: bool = False
    downsamples: bool = False


TABLE: dict[str, HoldRow] = {
    "zoh": HoldRow("samples", "zero_order", gives_samples=True, interpolates=True),
    "lead": HoldRow("lead", "lead", depth=2),
    "foh": HoldRow("samples", "first_order", depth=2, degree=1, interpolates=True),
    "foh-derivative": HoldRow("samples", "first_order_derivative", needs="derivative", degree=1),
    "slope": HoldRow("samples", "slope", depth=2, needs="integral"),
    "second-order": HoldRow("samples", "second_order", depth=3, degree=2, interpolates=True),
    "hermite": HoldRow(
        "samples", "hermite", depth=2, needs="derivative", degree=3, interpolates=True
    ),
    "delayed": HoldRow("delayed", "delayed", depth=2, remembers=1, degree=1),
    "smooth": HoldRow("smooth", "smooth", depth=2, remembers=2, degree=3),
    "model": HoldRow("samples", "model", needs="gradient", downsamples=True),
    "ahead": HoldRow("samples", "ahead", depth=2, needs="step", degree=3),
    "passive": HoldRow("account", "passive", needs="power"),
    "nepce": HoldRow("account", "nearly_energy_preserving", needs="power"),
    "pspm": HoldRow("set_position", "set_position", needs="spring"),
    "latest": HoldRow("samples", "zero_order", gives_samples=True, downsamples=True),
    "mean": HoldRow("mean", "mean", remembers=3, downsamples=True),
    "half-lead": HoldRow("mean", "half_lead", remembers=3, downsamples=True),
    "reaction": HoldRow("reaction", "reaction", remembers=15, needs="reaction"),
    "mid": HoldRow("mid", "mid", remembers=1, needs="coupling", downsamples=True),
}
"""By the name in a scene, which tells what a hold is: docs/holds.md."""
IN_PYTHON = HoldRow("in_python", "in_python")
"""Of the holds of plugins, which are called back."""
ROWS = (*TABLE.values(), IN_PYTHON)
"""By the number that a hold in C has as its kind."""


def hold_table_h() -> str:
    """hold_table.h: the functions of all rows, in this order."""
    names = dict.fromkeys(f"Push push_{row.push};" for row in ROWS)
    names |= dict.fromkeys(f"Value value_{row.value};" for row in ROWS)
    rows = (f"    {{push_{row.push}, value_{row.value}}}," for row in ROWS)
    declared = "\n".join(names)
    deepest = f"#define DEEPEST {max(row.depth for row in ROWS)}"
    return (
        f"/* Made of orchestrator/holds/table.py. */\n\n{declared}\n\n{deepest}\n\n"
        + " \\\n".join(["#define HOLD_TABLE", *rows, ""])
    )
