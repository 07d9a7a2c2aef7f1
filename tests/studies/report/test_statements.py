"""The table of the report's statements: nothing is missing, verdicts and commands are sound, and
numbers of those that differ are what runs give."""

import csv
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from hapticlink.commands import _commands
from studies.report import measures
from studies.report.chapter6 import LENGTH_SCALE
from studies.report.report_page import Runs
from studies.report.statements import (
    every_statement,
    introduction,
    paper_experiment,
    rendering,
)
from studies.report.statements.statement import misprint
from studies.report.systems import IDEAL_6, IDEAL_B6, OFF, ON, STATED_6, STATED_B6
from tests.docs.test_examples import parsed
from tests.mechanisms import MOBILITY

ROOT = Path(__file__).parents[3]
EQUATIONS = [
    *(f"1.{k}" for k in range(1, 4)),
    *(f"2.{k}" for k in range(1, 19)),
    *(f"3.{k}" for k in range(1, 6)),
    *(f"4.{k}" for k in range(1, 7)),
    *(f"5.{k}" for k in range(1, 12)),
    *(f"A.{k}" for k in range(1, 8)),
    *(f"B.{k}" for k in range(1, 18)),
]
FIGURES = [
    *(f"1.{k}" for k in range(1, 6)),
    *(f"2.{k}" for k in range(1, 3)),
    *(f"3.{k}" for k in range(1, 6)),
    *(f"4.{k}" for k in range(1, 8)),
    *(f"6.{k}" for k in range(1, 4)),
    *(f"B.{k}" for k in range(1, 7)),
]
SECTIONS = [
    "abstract", "1.1", "1.2", "1.3", "1.3.1", "1.3.2", "1.3.3", "1.3.4", "1.4", "2.1", "2.2",
    "2.2.1", "2.2.2", "2.2.3", "3", "4.1", "4.2", "4.2.1", "4.2.2", "4.2.3", "4.2.4", "4.2.5", "5",
    "5.1", "5.2", "6", "7", "A", "B.1", "B.2", "B.3", "B.4", "B.5", "B.6", "B.7",
]  # fmt: skip
NOTES = ["B.6, note 1", "B.6, note 2", "B.6, note 3"]
VERDICTS = {"agrees", "differs", "cannot be compared"}


@pytest.fixture(scope="module")
def table():
    """The rows of results/report/statements.csv."""
    with (ROOT / "results/report/statements.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return Runs(tmp_path_factory.mktemp("runs"), lambda _: None)


def test_every_part_of_the_report_has_a_statement(table):
    text = "; ".join(row["place"] for row in table)
    sections = {part.partition(" (")[0].partition(",")[0] for part in text.split("; ")}
    missing = [f"({e})" for e in EQUATIONS if f"({e})" not in text]
    missing += [f"figure {f}" for f in FIGURES if not re.search(rf"figure {f}(\b|\()", text)]
    missing += [t for t in ("table 6.1", "table B.1", *NOTES) if t not in text]
    missing += [s for s in SECTIONS if s not in sections]
    assert missing == []


def test_verdicts_are_three_and_numbers_are_there(table):
    assert {row["verdict"] for row in table} == VERDICTS
    assert [row for row in table if not (row["number"] and row["statement"])] == []
    differ = [row["verdict"] == "differs" for row in table]
    assert differ == sorted(differ, reverse=True)


def commands(table):
    return {command for row in table for command in row["command"].split("; ")} - {"-"}


def test_only_what_cannot_be_compared_has_no_command(table):
    assert {row["verdict"] for row in table if row["command"] == "-"} == {"cannot be compared"}


def test_every_command_can_be_pasted_into_a_shell(table):
    """One program, without operators or patterns of the shell outside of quotes; its words, keys
    and values are accepted."""
    _commands([])
    for command in commands(table):
        words = shlex.split(command)
        assert shlex.join(words) == command
        if words[0] != "pytest":
            parsed(command)


def test_every_test_that_is_named_is_there(table):
    named = [c.removeprefix("pytest ") for c in commands(table) if c.startswith("pytest ")]
    assert len(named) > 20
    for path, _, test in (name.partition("::") for name in named):
        assert not test or f"def {test}(" in (ROOT / path).read_text(), (path, test)


def test_what_a_test_shows_names_it(table):
    by_test = [row["command"] for row in table if row["number"].startswith("by the test")]
    assert by_test
    assert all(command.startswith("pytest tests/") for command in by_test)


def test_what_is_no_misprint_is_refused():
    with pytest.raises(ValueError, match=r"\(1\.1\): not the misprint that it is taken for"):
        misprint("(1.1)", "a rule", 1e-15, "another", 1e-15, "none")
    with pytest.raises(ValueError, match="not the misprint"):
        misprint("(1.1)", "a rule", 1.0, "another", 0.5, "none")


def test_the_table_is_that_of_the_runs(table, runs):
    """Each statement with its verdict; numbers as far as they are the same on all machines."""
    made = sorted((s.place, s.text, s.verdict, s.command) for s in every_statement(runs))
    keys = ("place", "statement", "verdict", "command")
    assert made == sorted(tuple(row[key] for key in keys) for row in table)


def test_a_slowly_updated_inertia_has_an_influence(runs):
    """4.2.2, against a copy at the haptic rate."""
    assert rendering.inertia_by_rate(runs) == pytest.approx({10: 67, 30: 21, 60: 13}, abs=1)


@pytest.mark.parametrize("rate", [128.0, 512.0, 1000.0])
def test_a_sampled_damper_produces_energy_above_a_quarter_of_the_rate(rate):
    """1.3.2: its work over a sine goes as cos(2 pi f / rate)."""
    assert introduction.lowest_generating(rate) == pytest.approx(rate / 4, abs=1)


def test_the_mechanism_accelerates_along_what_it_resists(runs):
    """4.2.1, against the rate of the recorded velocity along the null direction."""
    results = IDEAL_6.run(runs, ON)
    haptics, scale = results.haptics, np.array((1, 1, LENGTH_SCALE))
    n = np.linalg.svd(haptics["virtual_mechanism.Lambda_inv"] * np.outer(scale, scale))[0][:, :, 2]
    rate = np.gradient(haptics["virtual_mechanism.v"], haptics["time"], axis=0) * scale
    expected = np.sqrt(np.mean(np.sum(n * rate, axis=1) ** 2)), np.linalg.norm(rate) / len(n) ** 0.5
    found = measures.resisted_acceleration(results, LENGTH_SCALE)
    assert found == pytest.approx(expected, rel=0.05)
    assert found[0] > 0.2 * found[1]


def test_multipliers_are_not_zero_with_one_constraint(runs):
    one, two = measures.by_count(IDEAL_B6.run(runs, ON)).multipliers
    assert one == pytest.approx(1.07, rel=0.02)
    assert two > 2 * one


def test_two_stiffnesses_do_not_confine_tighter(runs):
    one, two = measures.by_count(IDEAL_B6.run(runs, ON)).distance
    assert (one, two) == pytest.approx((0.32, 0.92), rel=0.05)


def test_position_channels_are_as_stiff_as_the_topology_controller(runs):
    """Against the mobility that Pinocchio gives."""
    k_j, values = rendering.channel_stiffness(IDEAL_6.run(runs, ON))
    expected = np.sort(np.linalg.eigvals(MOBILITY @ np.diag((100.0, 100.0, 0.5))).real)[::-1]
    assert k_j == 200
    np.testing.assert_allclose(values, expected, atol=1e-9)
    np.testing.assert_allclose(values[:2], (288, 58), atol=0.5)


def test_impedance_control_ends_long_after_the_loop_is_active(runs):
    off = IDEAL_B6.run(runs, OFF)
    assert measures.count(off).episodes[0][0] == pytest.approx(0.78, abs=0.01)
    assert off.record.end.time == pytest.approx(2.86, abs=0.01)
    assert STATED_B6.run(runs, OFF).record.end.time == pytest.approx(2.63, abs=0.01)


def test_readings_of_the_stiffness_have_consequences(runs):
    apart = [worst for _, _, worst in paper_experiment.readings(runs)]
    assert apart[0] == pytest.approx(15.7, rel=0.02)
    assert apart[1] > 2 * apart[0]


def test_as_stated_the_experiment_stops_at_the_workspace_limit(runs):
    """Chapter 6 without the topology controller; idealised it does not within 3 s."""
    assert STATED_6.run(runs, OFF).record.end.reason == "stop_when"
    assert IDEAL_6.run(runs, OFF).record.end.reason == "duration"
