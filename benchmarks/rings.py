"""Rings of FMUs that pass on their inputs, y = u/2 + 1, for masters to run: a scene and its SSP."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

from benchmarks.peers.masters import SCENE, SSP
from hapticlink.api.files import export
from hapticlink.components.blocks import BLOCKS
from hapticlink.components.component import Block, Component, Variable

PACKAGINGS = ("native", "python", "pythonfmu")
"""C of this project's builder; its Python FMUs; a slave of pythonfmu, packed by its own builder."""
SLAVE = """\
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class PassOn(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for i in range(1, {n} + 1):
            setattr(self, f"u{{i}}", 0.0)
            setattr(self, f"y{{i}}", 0.0)
            self.register_variable(
                Real(f"u[{{i}}]", causality=Fmi2Causality.input,
                     getter=lambda i=i: getattr(self, f"u{{i}}"),
                     setter=lambda v, i=i: setattr(self, f"u{{i}}", v)))
            self.register_variable(
                Real(f"y[{{i}}]", causality=Fmi2Causality.output,
                     getter=lambda i=i: getattr(self, f"y{{i}}")))

    def do_step(self, current_time, step_size):
        for i in range(1, {n} + 1):
            setattr(self, f"y{{i}}", getattr(self, f"u{{i}}") / 2 + 1)
        return True
"""


def pass_on(signals: int = 3) -> Component:
    """y = u/2 + 1."""
    block = Block(inputs=[Variable("u", (signals,), "m")], outputs=[Variable("y", (signals,), "m")])
    output = {"y": block.u["u"] / 2 + 1}
    return block.component("pass_on", "passes on", "continuous", initial={}, step={}, output=output)


def register() -> None:
    """Make the block known to scenes."""
    if "pass-on" not in BLOCKS:
        BLOCKS.register("pass-on", pass_on)


def make(packaging: str, n: int, signals: int, folder: Path) -> None:
    """Write to `folder` the scene and the SSP of a ring of n FMUs with `signals` reals each, and
    unpack the SSP in `ssp/`."""
    register()
    if packaging == "pythonfmu":
        from pythonfmu.builder import FmuBuilder

        (folder / "pass_on.py").write_text(SLAVE.format(n=signals))
        FmuBuilder.build_FMU(folder / "pass_on.py", dest=folder)
        os.rename(folder / "PassOn.fmu", folder / "slave.fmu")
        of = 'path = "slave.fmu"'
    else:
        of = f'block = "pass-on"\nsettings = {{ signals = {signals} }}'
    lines = ['title = "ring"', "duration = 1.0", 'coupling = "jacobi"', "haptics.rate = 512"]
    if packaging != "pythonfmu":
        lines.append(f'packaging = "{packaging}"')
    for i in range(n):
        lines += ["[[fmu]]", f'name = "f{i}"', of]
        lines += ["[[connection]]", f'from = "f{i}.y"', f'to = "f{(i + 1) % n}.u"']
    (folder / SCENE).write_text("\n".join([*lines, ""]))
    ssp = export(str(folder / SCENE), out=folder / SSP)
    with zipfile.ZipFile(ssp) as archive:
        archive.extractall(folder / "ssp")
