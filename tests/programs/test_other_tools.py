"""The one FMU of a scene, with graphics at 30 Hz, in other masters: the bits of the run."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.orchestrator.ssp.test_other_tools import ecos  # noqa: F401
from tests.programs.built import needs_compiler, program
from tests.programs.comparison import run

pytestmark = needs_compiler
OPTIONS = ("duration=0.25", "graphics.rate=30")
STEPS = 128
Values = Callable[[], Sequence[float]]


def equal_a_run(columns: list[str], step: Callable[[], object], values: Values, folder: Path):
    """Whether outputs of plants have the bits of a run after each step."""
    rows = run("closed-loop-ideal", OPTIONS, folder).results.haptics
    for row in range(1, STEPS + 1):
        step()
        assert [*values()] == [rows[column][row] for column in columns], row


COLUMNS = [f"virtual_mechanism.{x}[{i}]" for x in ("x", "v") for i in (1, 2, 3)]


def test_libcosim(tmp_path: Path) -> None:
    pytest.importorskip("libcosimpy")
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(1_000_000_000 // 512)
    scene = CosimLocalSlave(str(program("closed-loop-ideal", OPTIONS)), "scene")
    index = execution.add_local_slave(scene)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    known = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
    references = [known[column] for column in COLUMNS]
    values = lambda: observer.last_real_values(index, references)  # noqa: E731
    equal_a_run(COLUMNS, execution.step, values, tmp_path)


def test_ecos(ecos: Any, tmp_path: Path) -> None:  # noqa: F811
    structure = ecos.EcosSimulationStructure()
    structure.add_model("scene", str(program("closed-loop-ideal", OPTIONS)))
    names = [f"scene::{column}" for column in COLUMNS]
    with ecos.EcosSimulation(step_size=1 / 512, structure=structure) as simulation:
        simulation.init()
        values = lambda: [simulation.get_real(name) for name in names]  # noqa: E731
        equal_a_run(COLUMNS, lambda: simulation.step(1), values, tmp_path)
