"""The order of plants: that of their connections, whatever the order of the file; loops named."""

from itertools import permutations
from pathlib import Path

import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.plan.explain import explain
from hapticlink.orchestrator.plan.plan import Plan
from tests.little_fmus import edited, python_fmu
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table

COUPLING = "coupling=gauss-seidel-plants"
CHAIN = ("a", "b", "c")


def wired(folder: Path, names: tuple[str, ...], *wires: tuple[str, str]) -> Path:
    """A scene of FMUs, each of which adds its step to what it takes."""
    text = "".join(fmu_table(n, n) for n in names)
    return scene(folder, text + "".join(wire_table(f"{a}.y", f"{b}.u") for a, b in wires))


@pytest.fixture
def fmus(tmp_path):
    for name in CHAIN:
        python_fmu(tmp_path, name, "self.y = self.u + size")
    return tmp_path


def test_the_order_of_the_file_changes_nothing_in_a_chain(fmus):
    for k, names in enumerate(permutations(CHAIN)):
        path = wired(fmus, names, ("a", "b"), ("b", "c"))
        experiment = simulate(str(path), fmus / f"{k}", [COUPLING])
        table = experiment.results.haptics
        # Each takes the end of the step before it: c is three steps after the first.
        assert table["c.y"][1:].tolist() == [3 / 64] * 32
        assert experiment.results.run["loops"] == []


@pytest.mark.parametrize(
    ("coupling", "found"),
    [
        ("gauss-seidel-plants", [{"fmus": ["b", "c"], "ring": "b -> c -> b"}]),
        ("gauss-seidel", []),
        ("jacobi", []),
    ],
)
def test_a_loop_is_named(fmus, coupling, found):
    path = wired(fmus, ("b", "c", "a"), ("b", "c"), ("c", "b"), ("c", "a"))
    experiment = simulate(str(path), fmus / "out", [f"coupling={coupling}"])
    assert experiment.results.run["loops"] == found
    told = "\n".join(explain(Plan(experiment.system)))
    assert ("loop b -> c -> b: b, c in this order" in told) == bool(found)


def test_direct_dependencies_order_a_loop(fmus):
    """b's outputs follow its input of the instant, c's do not: c goes first."""

    def without(text):
        outputs = text[text.index("<Outputs>") : text.index("</Outputs>")]
        return text.replace(outputs, outputs.replace("<Unknown ", '<Unknown dependencies="" '))

    edited(fmus / "c.fmu", without)
    for names in (("b", "c"), ("c", "b")):
        path = wired(fmus, names, ("b", "c"), ("c", "b"))
        experiment = simulate(str(path), fmus / "-".join(names), [COUPLING])
        assert experiment.results.run["loops"][0]["fmus"] == ["c", "b"]
        # c takes b of the tick, b the end of c's step.
        assert experiment.results.haptics["b.y"][1] == 2 / 64
