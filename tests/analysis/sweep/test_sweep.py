"""Sweeps: what is varied, rows that outlive interruptions, one table whatever the processes."""

import csv
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.analysis.sweep import grid, pool, row, run_sweep, table
from hapticlink.analysis.sweep import job as points_of
from hapticlink.analysis.sweep.grid import Axis, listed, parse
from hapticlink.analysis.sweep.job import Job
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault, Interrupted
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.results.read_results import Results, Table
from hapticlink.orchestrator.results.run_record import ClockSteps, Energy
from hapticlink.visualization.figures import sweep_figure
from tests.little_fmus import slave
from tests.orchestrator.results.records import run_json
from tests.shared_fixtures import status

# --- what is varied ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("k=10..13", ["10", "11", "12", "13"]),
        ("k=10..60..20", ["10", "30", "50"]),
        ("k=0.1..0.4..0.1", ["0.1", "0.2", "0.3", "0.4"]),
        ("k=0..1:5", ["0", "0.25", "0.5", "0.75", "1"]),
        ("k=-2..-1..0.5", ["-2", "-1.5", "-1"]),
        ("k=zoh, lead,foh", ["zoh", "lead", "foh"]),
        ("k=8..10,512", ["8", "9", "10", "512"]),
        ("k=[1, 2],[3, 4]", ["[1, 2]", "[3, 4]"]),
        ("k={ min = 10, max = 60 },30", ["{ min = 10, max = 60 }", "30"]),
        ("k='a,b',c", ["'a,b'", "c"]),
        ("k=a.b[1] > 3", ["a.b[1] > 3"]),
        ("k=1,1,2", ["1", "2"]),
        ("k=1e3..1002", ["1000", "1001", "1002"]),
    ],
)
def test_values(text: str, values: list[str]) -> None:
    assert parse(text) == Axis("k", tuple(values))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("k", "write key=values"),
        ("=1", "write key=values"),
        ("k=", "no value"),
        ("k=60..10", "write 10..60"),
        ("k=0.5..2", "write 0.5..2..STEP"),
        ("k=1..2..0", "take a larger one"),
        ("k=1..9:1", "give 2 to"),
        ("k=0..1..1e-9", "take a larger one"),
    ],
)
def test_values_that_cannot_be_read(text: str, message: str) -> None:
    with pytest.raises(InputFault, match="--vary") as fault:
        parse(text)
    assert message in str(fault.value)


@given(st.integers(-500, 500), st.integers(1, 50), st.integers(0, 50), st.integers(0, 3))
def test_a_range_in_steps_is_exact(first: int, step: int, count: int, digits: int) -> None:
    """Decimal fractions in steps never become binary ones: 0.1..0.3..0.1 has 0.3."""
    unit = Decimal(1).scaleb(-digits)
    a, h = first * unit, step * unit
    axis = parse(f"k={a:f}..{a + count * h:f}..{h:f}")
    assert [Decimal(v) for v in axis.values] == [a + i * h for i in range(count + 1)]


def test_a_grid_is_every_combination_the_first_axis_slowest() -> None:
    points = grid.grid([Axis("a", ("1", "2")), Axis("b", ("x", "y"))])
    assert [tuple(p.values()) for p in points] == [("1", "x"), ("1", "y"), ("2", "x"), ("2", "y")]
    with pytest.raises(InputFault, match="given twice"):
        grid.grid([Axis("a", ("1",)), Axis("a", ("2",))])


def test_runs_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(
        'hold,graphics.rate\nzoh,30\nfoh,"{ min = 10, max = 60 }"\n,5\n'
    )
    assert listed(tmp_path / "runs.csv") == [
        {"hold": "zoh", "graphics.rate": "30"},
        {"hold": "foh", "graphics.rate": "{ min = 10, max = 60 }"},
        {"graphics.rate": "5"},
    ]
    (tmp_path / "runs.toml").write_text(
        '[[run]]\nhold = "zoh"\n[run.graphics.rate]\nmin = 10\nmax = 60\n'
        "[[run]]\nhand.wrench = [1, 0, 0]\n"
        "[[run]]\nat = [{ time = 0.3, set = { hold = 'foh' } }]\n"
    )
    assert listed(tmp_path / "runs.toml") == [
        {"hold": "zoh", "graphics.rate.min": "10", "graphics.rate.max": "60"},
        {"hand.wrench": "[1, 0, 0]"},
        {"at": '[{ "time" = 0.3, "set" = { "hold" = "foh" } }]'},
    ]
    for name, text in (
        ("a.csv", "hold\n"),
        ("b.csv", "a,b\n1\n"),
        ("c.toml", "run = 1"),
        ("d.toml", "="),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputFault, match=name):
            listed(tmp_path / name)


# --- a row ------------------------------------------------------------------------------------


def test_the_numbers_of_a_row(tmp_path: Path) -> None:
    """A mechanism at rest at the graphics rate, a device that goes away from it by 3 and 4 mm/s and
    0.1 rad/s: 5 mm and 0.1 rad after 1 s, RMS 5/sqrt(3) mm but for the grid."""
    fast, slow = np.arange(101) / 100, np.arange(11) / 10
    device = np.outer(fast, [3e-3, 4e-3, 0.1])
    rest = np.zeros((11, 3))
    count = np.array([0, 0, 1, 1, 2, 2, 2, 1, 1, 1, 1.0])[:, None]
    closure = np.linspace(0, -2e-6, 11)[:, None]

    def columns(name: str, n: int) -> list[str]:
        return [f"{name}[{i + 1}]" for i in range(n)]

    names = ["time", *columns("virtual_mechanism.x", 3), "virtual_mechanism.n_constraints"]
    tables = {
        "haptics": Table(
            ("time", *columns("haptic_device.x_true", 3)), np.column_stack([fast, device])
        ),
        "graphics": Table(
            (*names, "virtual_mechanism.closure_error"),
            np.column_stack([slow, rest, count, closure]),
        ),
    }
    fmus = {
        name: {"rate": "haptics", "timing": "continuous", "block": name}
        for name in ("virtual_mechanism", "haptic_device")
    }
    run = run_json(
        fmus=fmus,
        clocks={name: asdict(ClockSteps(0.01, 0.01, 0.01)) for name in tables},
        holds={"a -> b": "zoh"},
        end={"reason": "stop_when", "time": 1.0},
        energies={"a -> b": asdict(Energy(0.25, 1.0, 0.75, 1.0, 0.5))},
        energies_within_a_rate={"c -> d": asdict(Energy(9.0, 9.0, 0.0, 1.0, 9.0))},
        calls={"m": {"step": 10, "get": 11}},
    )
    made = row.of_results(Results(tmp_path, run, tables))
    assert made["tracking_max_mm"] == pytest.approx(5, rel=1e-12)
    grid_rms = 5 * np.sqrt(np.mean(slow**2))
    assert made["tracking_rms_mm"] == pytest.approx(grid_rms, rel=1e-12)
    assert made["theta_max_rad"] == pytest.approx(0.1, rel=1e-12)
    assert made["closure_max_m"] == 2e-6
    assert made["switches"] == 3
    assert made["held_energy_generated_J"] == made["generated_J a -> b"] == 0.25
    assert "generated_J c -> d" not in made
    assert (made["steps m"], made["end"], made["end_time_s"]) == (10, "stop_when", 1.0)
    assert list(made)[-1] == "run_time_s"


# --- whole sweeps -----------------------------------------------------------------------------


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of rows, not of processes, each of which would import everything again."""

    def one_by_one(work: pool.Work, batches: Sequence[pool.Batch], n: int) -> Iterator[pool.Done]:
        return (done for batch in batches for done in zip(batch, work(batch), strict=True))

    monkeypatch.setattr(pool, "in_processes", one_by_one)


def read(folder: Path) -> list[dict[str, str]]:
    """The rows of the table, without the run time."""
    with (folder / "table.csv").open(newline="") as file:
        return [{k: v for k, v in r.items() if k != "run_time_s"} for r in csv.DictReader(file)]


def ends(folder: Path) -> list[str]:
    return [row["end"] for row in read(folder)]


def test_one_table_whatever_the_processes(bar: Path, tmp_path: Path) -> None:
    limits = (0.01, 0.05, 0.1)
    vary = "stop_when=" + ",".join(f"virtual_mechanism.x[1] > {limit}" for limit in limits)
    tables = []
    for jobs in (1, 2):
        out = tmp_path / str(jobs)
        assert status("sweep", bar, "--vary", vary, "--out", out, "--jobs", jobs) == 0
        assert (out / "sweep.png").is_file()
        assert not (out / ".running").exists()
        tables.append(read(out))
    assert tables[0] == tables[1]
    # x = t/2: the run ends at the first tick at which that is above the limit.
    times = [(np.floor(1024 * limit) + 1) / 512 for limit in limits]
    assert [float(r["end_time_s"]) for r in tables[0]] == times
    assert {r["end"] for r in tables[0]} == {"stop_when"}


def test_a_process_of_many_runs_makes_each_as_a_process_of_its_own(
    tmp_path: Path, emptied_temporary_folder: Path
) -> None:
    """Rates, holds and masses in turn: the bytes of single runs, FMUs in their place from the first
    run on, and nothing left."""
    points = [
        {"duration": "0.1", "haptics.rate": "256", "linkage.body.link1.mass": "0.5"},
        {"duration": "0.1", "hold": "foh"},
    ]
    made = points_of.jobs("closed-loop-ideal", (), points)

    def rows(job: Job) -> bytes:
        assert job.scene
        out = tmp_path / "run"
        assert simulate(job.scene, out, csv=False).outcome.fault is None
        return b"".join(path.read_bytes() for path in sorted(out.glob("*.rows")))

    single = [rows(job) for job in made]
    assert single[0] != single[1]
    mapped, folders = [], []
    with process_cache.keep_unpacked():
        for _ in range(3):
            assert [rows(job) for job in made] == single
            mapped.append(Path("/proc/self/maps").read_text().count(str(emptied_temporary_folder)))
            folders.append(len([*emptied_temporary_folder.iterdir()]))
        assert mapped[0] == mapped[-1]
        assert folders[0] == folders[-1]
        process_cache.trim(1)
        assert len([*emptied_temporary_folder.iterdir()]) == 1
    assert not [*emptied_temporary_folder.iterdir()]


def test_native_fmus_that_are_there_are_taken_for_the_same_rows(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = [{"stop_when": f"virtual_mechanism.x[1] > {limit}"} for limit in (0.01, 0.02)]
    made = points_of.jobs(bar, ("duration=0.1",), limits)

    def rows(cache: str) -> list[row.Row]:
        monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / cache))
        found = run_sweep.sweep(made, run_sweep.Means(tmp_path / f"{cache}-sweep"))
        return [{k: v for k, v in each.items() if k != "run_time_s"} for each in found]

    python = rows("python")
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "native"))
    simulate(bar, tmp_path / "run", ("duration=0.1", "packaging=native"))
    there = sorted((tmp_path / "native").rglob("*.fmu"))
    assert rows("native") == python
    assert sorted((tmp_path / "native").rglob("*.fmu")) == there


@pytest.mark.usefixtures("in_this_process")
def test_a_failed_run_is_a_row(bar: Path, tmp_path: Path) -> None:
    # Refused by the scene's checks, by the system in its process, and a fault of the run.
    (tmp_path / "runs.csv").write_text(
        "coupling,stop_when,linkage.start.slide,linkage.start_velocity.slide\n"
        "jacobi,,,\njacoby,,,\n,hand.G < 0,,\n,,1.7e308,1e308\n"
    )
    out = tmp_path / "out"
    assert status("sweep", bar, "--runs", tmp_path / "runs.csv", "--out", out, "--jobs", 1) == 0
    rows = read(out)
    assert [r["end"] for r in rows] == ["duration", "refused", "refused", "fault"]
    assert "did you mean 'jacobi'?" in rows[1]["message"]
    assert "there is no such output" in rows[2]["message"]
    assert rows[3]["message"].startswith("virtual_mechanism: ")


@pytest.mark.usefixtures("in_this_process")
def test_what_no_run_can_use_is_bad_input(
    bar: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("--out", tmp_path / "out")
    assert status("sweep", bar, "--vary", "haptic.rate=1,2", *out) == 2
    assert "did you mean 'haptics'?" in capsys.readouterr().err
    assert status("sweep", bar, *out) == 2
    assert status("sweep", bar, "--vary", "duration=0.1", "--jobs", 0, *out) == 2
    assert status("sweep", bar, "--vary", "stop_when=hand.G < 0", *out) == 2  # refused in its run


@pytest.mark.usefixtures("in_this_process")
def test_a_sweep_of_which_nothing_is_left_fails(bar: Path, tmp_path: Path) -> None:
    line = ("sweep", bar, "--vary", "duration=0.1,0.2", "--out", tmp_path / "out", "--jobs", 1)
    set_ = ("--set", "linkage.start.slide=1.7e308", "--set", "linkage.start_velocity.slide=1e308")
    assert status(*line, *set_) == 1
    assert ends(tmp_path / "out") == ["fault", "fault"]


@pytest.mark.usefixtures("in_this_process")
def test_a_misspelt_metric_is_told_before_anything_runs(
    bar: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    line = ("sweep", bar, "--vary", "duration=0.1", "--out", out, "--jobs", 1, "--metric")
    assert status(*line, "steps virtual_mechansm") == 2
    assert "did you mean 'steps virtual_mechanism'?" in capsys.readouterr().err
    assert not out.exists()
    assert status(*line, "steps virtual_mechanism") == 0


DIES = """
        if self.die == 1.0:
            os._exit(3)"""
UNIT = ("output", {"y": 0.0}), ("tunable", {"die": 0.0, "nap": 0.0})


def unit(folder: Path, y: str = "end", act: str = DIES, keys: str = "duration = 0.2") -> Path:
    """A scene of one FMU, which gives y and can take its time or `act`."""
    body = f"""import os, time as clock{act}
        clock.sleep(self.nap)
        self.y = {y}"""
    slave(folder, "Unit", *UNIT, body=body)
    path = folder / "foreign.toml"
    path.write_text(f"""title = "One unit"
haptics.rate = 100
{keys}
[[fmu]]
name = "unit"
path = "Unit.fmu"
rate = "haptics"
start = {{ die = 0.0, nap = 0.0 }}
""")
    return path


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A scene of one FMU that can crash its process, or take its time."""
    return unit(tmp_path)


def test_a_crashed_process_takes_one_run(foreign: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    vary = "fmu.unit.start.die=0.0,1.0,2.0"
    assert status("sweep", foreign, "--vary", vary, "--out", out, "--jobs", 2) == 0
    assert ends(out) == ["duration", "died", "duration"]
    assert len(list((out / "rows").iterdir())) == 2  # the next sweep tries the dead one again


def pids(batch: pool.Batch) -> list[row.Row]:
    if batch[0].key == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    return [{"pid": os.getpid()} for _ in batch]


def test_processes_are_kept_for_further_rounds_and_replaced(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where one dies, and after a number of runs."""

    def round_of(*keys: str) -> list[object]:
        batches = [[Job({}, None, key)] for key in keys]
        return [made.get("pid") for _, made in pool.in_processes(pids, batches, 1)]

    monkeypatch.setattr(pool, "RUNS", 2)
    assert len({*round_of("a", "b", "c")}) == 2
    monkeypatch.undo()
    with pool.keep_processes():
        (first,), again = round_of("a"), round_of("b", "c")
        assert again == [first, first]
        assert round_of("dies") == [None]
        (new,) = round_of("a")
        assert new != first
        assert round_of("b") == [new]
    assert round_of("a") != [new]
    assert not multiprocessing.active_children()


def test_what_fails_for_the_machine_is_made_again_and_what_the_scene_gives_is_not(
    tmp_path: Path,
) -> None:
    """An FMU that does not answer, one that raises, one whose process is killed, while a file is
    there; and one that always diverges."""
    ill, log = tmp_path / "ill", tmp_path / "log"
    act = f"""
        with open({str(log)!r}, "a") as file:
            print(self.die, file=file)
        if self.die == 4.0:
            self.y = float("nan")
            return True
        if os.path.exists({str(ill)!r}):
            if self.die == 1.0:
                clock.sleep(1000)
            if self.die == 2.0:
                raise OSError("no space left on device")
            if self.die == 3.0:
                os.kill(os.getpid(), 9)"""
    path = unit(tmp_path, act=act, keys="duration = 0.02\nisolate = true\nfaults.timeout = 2.0")
    line = ("sweep", path, "--vary", "fmu.unit.start.die=0.0,1.0,2.0,3.0,4.0", "--jobs", 1)
    ill.touch()
    assert status(*line, "--out", tmp_path / "out") == 0
    assert ends(tmp_path / "out") == ["duration", "died", "died", "died", "fault"]
    ill.unlink()
    before = log.read_text()
    assert status(*line, "--out", tmp_path / "out") == 0
    assert ends(tmp_path / "out") == ["duration"] * 4 + ["fault"]
    again = log.read_text().removeprefix(before).split()
    assert set(again) == {"1.0", "2.0", "3.0"}


def started(*arguments: object) -> subprocess.Popen[str]:
    """A sweep in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "hapticlink", "sweep", *map(str, arguments)],
        start_new_session=True, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def wait_until(holds: Callable[[], bool]) -> None:
    """For 60 s at most."""
    until = time.monotonic() + 60
    while not holds() and time.monotonic() < until:
        time.sleep(0.05)


def gone(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and process groups")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_sweep_goes_on(
    foreign: Path, tmp_path: Path, number: int, in_this_process: None
) -> None:
    out, naps = tmp_path / "out", "0.0001,0.0002,0.0003,0.4,0.5,0.6"
    vary = f"fmu.unit.start.nap={naps}"
    sweep = started(foreign, "--vary", vary, "--out", out, "--jobs", 2)
    wait_until(lambda: len(list(out.glob("rows/*.json"))) >= 3)
    sweep.send_signal(number)
    message = sweep.communicate(timeout=30)[1]
    wait_until(lambda: gone(sweep.pid))
    assert gone(sweep.pid)  # no worker outlives the sweep
    if number != signal.SIGKILL:
        assert sweep.returncode == 1
        assert "interrupted: 3 of 6 runs" in message
        assert ends(out) == ["duration"] * 3
        assert not (out / ".running").exists()
    kept = {p.name: p.read_text() for p in out.glob("rows/*.json")}
    assert len(kept) == 3
    # The rest, at another pace; a run of the same scene is not made again: its row is as it was.
    short = naps.replace(",0.4,0.5,0.6", ",0.0004")
    vary = f"fmu.unit.start.nap={short}"
    assert status("sweep", foreign, "--vary", vary, "--out", out, "--jobs", 1) == 0
    assert len(read(out)) == 4
    assert {n: (out / "rows" / n).read_text() for n in kept} == kept
    assert not (out / ".running").exists()


def test_a_sweep_that_is_interrupted_twice_leaves_nothing(foreign: Path, tmp_path: Path) -> None:
    """The second signal, at once, ends the process where it is."""
    out = tmp_path / "out"
    vary = "fmu.unit.start.nap=0.4,0.5,0.6"
    sweep = started(foreign, "--vary", vary, "--out", out, "--jobs", 2)
    wait_until(lambda: len(list(out.glob(".running/*"))) >= 2)
    for number in (signal.SIGINT, signal.SIGTERM):  # two of one kind may come as one
        sweep.send_signal(number)
    message = sweep.communicate(timeout=30)[1]
    wait_until(lambda: gone(sweep.pid))
    assert "interrupted twice" in message
    assert "resource_tracker" not in message
    assert not (out / ".running").exists()


@pytest.mark.usefixtures("in_this_process")
def test_a_run_is_made_again_where_its_fmu_has_changed(foreign: Path, tmp_path: Path) -> None:
    arguments = ("sweep", foreign, "--vary", "duration=0.1", "--out", tmp_path / "out")
    assert status(*arguments) == 0
    unit(tmp_path, "2 * end")
    assert status(*arguments) == 0
    assert len(list((tmp_path / "out" / "rows").iterdir())) == 2


def test_rows_that_are_broken_are_made_again(tmp_path: Path) -> None:
    rows = table.Rows(tmp_path)
    rows.keep("a", {"end": "duration"})
    (tmp_path / "b.json").write_text('{"end": "dur')
    (tmp_path / "c.json").write_text("3")
    assert rows.find("a") == {"end": "duration"}
    assert rows.find("b") is rows.find("c") is rows.find("d") is None
    assert json.loads((tmp_path / "a.json").read_text()) == {"end": "duration"}


# --- the figure -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "lines", "bars", "maps"),
    [
        (("a", "h"), 2, 0, 0),
        (("h", "a"), 2, 0, 0),
        (("h",), 0, 2, 0),
        (("a",), 1, 0, 0),
        (("a", "b"), 3, 0, 0),
        (("b", "a"), 0, 0, 1),
        (("h", "a", "b"), 6, 0, 0),
    ],
)
def test_every_shape_of_a_sweep_has_a_figure(
    keys: tuple[str, ...], lines: int, bars: int, maps: int
) -> None:
    """It shows the numbers of all runs that have one and lasted."""
    values = {"a": [str(i) for i in range(12)], "b": ["1", "2.5", "4"], "h": ["zoh", "foh"]}
    rows: list[row.Row] = [
        {**p, "end": "stop_when" if i == 1 else "duration", "tracking_max_mm": 10.0**i}
        for i, p in enumerate(grid.grid([Axis(k, tuple(values[k])) for k in keys]))
    ]
    del rows[0]["tracking_max_mm"]
    found = sweep_figure.draw(rows, keys)
    assert found is not None
    axes = found.axes[0]
    curves = [line.get_ydata() for line in axes.lines if line.get_marker() == "."]
    widths, cells = [bar.get_width() for bar in axes.patches], axes.collections
    assert (len(curves), len(widths), len(cells)) == (lines, bars, maps)
    values_of = [np.ma.filled(c.get_array(), np.nan).ravel() for c in cells]
    shown = np.concatenate([*curves, widths, *values_of])
    expected = [r["tracking_max_mm"] for r in rows[1:] if r["end"] == "duration"]
    assert sorted(shown[np.isfinite(shown)]) == sorted(expected)
    with pytest.raises(InputFault, match="there are tracking_max_mm"):
        sweep_figure.draw(rows, keys, "tracking")
    assert sweep_figure.draw([row.failed("died", "")], ()) is None


@pytest.mark.parametrize("metric", ["port_peak_J", "port_J shaping", "generated_J a.F -> b.F"])
def test_energies_are_drawn_in_mj(metric: str) -> None:
    rows = [{"k": str(k), "end": "duration", metric: 1e-3 * k} for k in (1, 2)]
    found = sweep_figure.draw(rows, ["k"], metric)
    assert found is not None
    axes = found.axes[0]
    assert axes.get_ylabel().endswith(" (mJ)")
    assert list(axes.lines[0].get_ydata()) == [1.0, 2.0]
    assert "down to 1\xa0mJ" in axes.get_title()


# --- a cluster --------------------------------------------------------------------------------


def test_without_dask_the_scheduler_says_what_to_install(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    arguments = ("--vary", "duration=0.1", "--out", tmp_path / "out", "--scheduler", "tcp://a:1")
    assert status("sweep", bar, *arguments) == 2
    assert install_command("distributed") in capsys.readouterr().err


def test_a_cluster_makes_the_same_table(bar: Path, tmp_path: Path, in_this_process: None) -> None:
    distributed = pytest.importorskip("dask.distributed")
    vary = "stop_when=virtual_mechanism.x[1] > 0.01,virtual_mechanism.x[1] > 0.05,hand.G < 0"
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    )
    with cluster:
        address = cluster.scheduler_address
        out = ("--out", tmp_path / "there")
        assert status("sweep", bar, "--vary", vary, "--scheduler", address, *out) == 0
    assert status("sweep", bar, "--vary", vary, "--out", tmp_path / "here") == 0
    assert read(tmp_path / "there") == read(tmp_path / "here")
    assert ends(tmp_path / "there") == ["stop_when", "stop_when", "refused"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_ends_a_sweep_while_its_points_are_read() -> None:
    read = []

    def points() -> Iterator[dict[str, str]]:
        for k in range(1, 100):
            read.append(k)
            if k == 3:
                os.kill(os.getpid(), signal.SIGINT)
            yield {"duration": str(k)}

    with interrupt.defer_signals(), pytest.raises(Interrupted):
        points_of.jobs("pendulum", [], points())
    assert len(read) <= 4


def test_the_run_time_is_the_last_column():
    assert table.columns([{"run_time_s": 1.0, "b": 2.0}, {"a": 3.0}]) == ["b", "a", "run_time_s"]


def test_points_of_one_rate_are_in_one_batch() -> None:
    """Whichever key varies first; a refused point is in one of them."""
    rates = ("20", "30", "nothing", "40")
    points = [
        {"graphics.rate": rate, "hand.wrench": f"[{x}, 0, 0]"} for x in range(8) for rate in rates
    ]
    jobs = points_of.jobs("closed-loop-ideal", (), points)
    batches = run_sweep.batches_of(jobs, 1)
    assert [len({job.point["graphics.rate"] for job in batch}) for batch in batches] == [1] * 4
    assert sorted(map(id, jobs)) == sorted(id(job) for batch in batches for job in batch)
    assert [len(batch) for batch in run_sweep.batches_of(jobs, 4)] == [2] * 16
    assert [len(batch) for batch in run_sweep.batches_of(jobs[:1] * 100, 1)] == [24] * 4 + [4]
    assert [len(batch) for batch in run_sweep.batches_of(jobs * 20, 2)] == [64] * 10
