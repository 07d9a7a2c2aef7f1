"""[[fmu]] with a block of the package, in place of an FMU's file."""

import numpy as np
import pytest

from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.scene import read_and_check

HEAD = 'title = "Poles"\nduration = 1.0\nhaptics.rate = 100\n'


def pole(name: str, rule: str, rate: str = "") -> str:
    return f"""
[[fmu]]
name = "{name}"
block = "discrete_equivalent"
settings.rule = "{rule}"
start.re = -2.0
{rate}
"""


def test_a_block_runs_under_any_name_and_at_any_rate(tmp_path):
    """x' = s x: z = 1/(1 - s h) backward, (1 + s h/2)/(1 - s h/2) trapezoidal, of each step."""
    text = HEAD + pole("fast", "backward") + pole("slow", "trapezoidal", "rate = 10")
    results = simulate(
        read_and_check.read_scene(text, ["fmu.fast.start.re=-3"]), tmp_path / "out"
    ).results
    backward = (1 / 1.03) ** np.arange(101)
    np.testing.assert_allclose(results.haptics["fast.x"][:, 0], backward, rtol=1e-13)
    trapezoidal = (0.9 / 1.1) ** np.arange(11)
    np.testing.assert_allclose(results.tables["10hz"]["slow.x"][:, 0], trapezoidal, rtol=1e-13)


@pytest.mark.parametrize(
    ("keys", "finding"),
    [
        (
            'block = "discrete_equivalnt"',
            "line 6: fmu[0] (one).block: no block 'discrete_equivalnt'; did you mean "
            "'discrete_equivalent'?",
        ),
        ('block = "discrete_equivalent"', "line 4: fmu[0] (one).settings.rule: is missing"),
        (
            'block = "discrete_equivalent"\nsettings = { rule = "backward", rul = 1 }',
            "line 7: fmu[0] (one).settings.rul: unknown key; did you mean 'rule'?",
        ),
        (
            'block = "haptic_device"\n[fmu.settings.device]\nsubsteps = "long"',
            "line 8: fmu[0] (one).settings.device.substeps: 'long' should be a valid integer",
        ),
        ("rate = 10", "line 4: fmu[0] (one).block: is missing, and so is path"),
    ],
)
def test_faults_stand_at_their_place(keys, finding):
    with pytest.raises(SceneFault) as fault:
        read_and_check.read_scene(f'{HEAD}[[fmu]]\nname = "one"\n{keys}\n')
    assert [finding] == [str(f)[: len(finding)] for f in fault.value.findings]


def test_a_file_takes_neither_block_nor_settings(tmp_path):
    (tmp_path / "a.fmu").touch()
    text = f'{HEAD}[[fmu]]\nname = "one"\npath = "a.fmu"\nblock = "hand"\nsettings.hand = 1\n'
    with pytest.raises(SceneFault) as fault:
        read_and_check.read_scene(text, folder=tmp_path)
    told = [f.key for f in fault.value.findings]
    assert told == [f"fmu[0] (one).{key}" for key in ("settings.hand", "block")]


def test_values_that_give_no_component(tmp_path):
    with pytest.raises(InputFault, match=r"discrete_equivalent: .*'sideways'"):
        simulate(read_and_check.read_scene(HEAD + pole("one", "sideways")), tmp_path / "out")
