"""A scene on two computers: real sockets and processes on loopback, and network namespaces. No time
is asserted: what arrives when is recorded, and a run with the record has the same bytes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from time import sleep
from typing import Any

import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.network import key_file
from hapticlink.orchestrator.results.read_results import read_table
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.network.served import (
    command,
    free_address,
    process,
    processes_of,
    relay,
    server,
    until,
)
from tests.shared_fixtures import sets, status

pytest.importorskip("zmq")
pytest.importorskip("msgpack")
OPTIONS = ("hold=foh", "duration=0.75")
SETS = sets(OPTIONS)


def tables(folder: Path) -> dict[str, bytes]:
    return {rate: (folder / f"{rate}.csv").read_bytes() for rate in ("haptics", "graphics")}


def run_at(at: str, folder: Path, out: Path, real_time: bool = True) -> dict[str, Any]:
    """The run.json of a run of closed-loop-ideal whose graphics are served."""
    where = {"graphics": at}
    return hl.run(
        "closed-loop-ideal", OPTIONS, out=out, figures=False, real_time=real_time, remote=where,
        key=folder / "key",
    ).run  # fmt: skip


def replayed(out: Path) -> dict[str, bytes]:
    """The tables of a run with the arrivals of another one."""
    again = out.with_name(f"{out.name}-again")
    run = hl.run("closed-loop-ideal", OPTIONS, out=again, figures=False, arrivals=out)
    assert run.fault is None
    assert run.run["real_time"]["deadlines_missed"] == 0
    assert f"without a clock; samples arrived as those of {out} did" in str(run)
    return tables(again)


def left_behind() -> list[str]:
    names = [thread.name for thread in threading.enumerate()]
    return [name for name in names if name.startswith("hapticlink-beside")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("served")


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[str]:
    """A server of closed-loop-ideal, to which runs come one after the other."""
    with server("closed-loop-ideal", folder, *SETS) as at:
        yield at
    assert not processes_of(folder)


def test_a_remote_fmu_has_the_bytes_of_one_here(folder: Path, served: str, tmp_path: Path) -> None:
    """Without real time the run waits for each step."""
    run = run_at(served, folder, tmp_path / "remote", real_time=False)
    assert run["fault"] is None
    assert run["isolated"]["virtual_environment"] == f"served from {served}"
    hl.run("closed-loop-ideal", OPTIONS, out=tmp_path / "here", figures=False)
    assert tables(tmp_path / "remote") == tables(tmp_path / "here")


@pytest.mark.parametrize(
    "network",
    [(0.0, 0.0, 0.0), (0.03, 0.03, 0.0), (0.01, 0.02, 0.2)],
    ids=["loopback", "jitter", "loss"],
)
def test_recorded_arrivals_replay_a_run(
    folder: Path, served: str, tmp_path: Path, network: tuple[float, ...]
) -> None:
    """A relay delays, loses and overtakes messages by a seed; 512 Hz go on."""
    out = tmp_path / "remote"
    with relay(folder, served, *network, 5, -1) as at:
        run = run_at(at, folder, out)
    assert run["fault"] is None
    assert len(read_table(out / "haptics.csv")["time"]) == 385
    assert replayed(out) == tables(out)
    sides, told = run["real_time"]["samples"]["graphics"], run["network"]["virtual_environment"]
    frames, samples = (
        read_table(out / f"{name}.csv")
        for name in ("virtual_environment_frames", "graphics_samples")
    )
    assert sides["taken"] == len(samples["time"]) - 1
    assert (frames["time"] == samples["time"]).all()
    assert (frames["sent"] < frames["arrived"])[1:].all()
    assert told["round_trip"]["min"] >= 2 * network[0]
    assert told["clock"]["offset_uncertainty"] >= network[0]
    assert abs(told["clock"]["offset"]) <= told["clock"]["offset_uncertainty"]  # the same clock
    assert (told["repeated"] > 0 and sides["late"] > 0) or not network[2]
    assert not left_behind()


def test_arrivals_of_another_run_are_refused(tmp_path: Path) -> None:
    hl.run("closed-loop-ideal", ["duration=0.05"], out=tmp_path / "plain", figures=False)
    with pytest.raises(InputFault, match="no run in real time"):
        hl.run("closed-loop-ideal", arrivals=tmp_path / "plain")
    hl.run(
        "closed-loop-ideal",
        ["duration=0.05"],
        out=tmp_path / "paced",
        figures=False,
        real_time=True,
    )
    with pytest.raises(InputFault, match="a run of another scene: hold differ"):
        hl.run("closed-loop-ideal", ["hold=foh"], arrivals=tmp_path / "paced")
    with pytest.raises(InputFault, match="without real time"):
        hl.run("closed-loop-ideal", real_time=True, arrivals=tmp_path / "paced")


def test_who_has_no_key_or_another_scene_is_refused(
    folder: Path, served: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [*SETS, "--out", tmp_path / "out", "--no-figures", "--remote", f"graphics={served}"]
    run = ("run", "closed-loop-ideal", *options)
    assert status(*run, "--key", tmp_path / "none") == 2
    assert "no key: " in capsys.readouterr().err
    key_file.create(tmp_path / "other")
    assert status(*run, "--key", tmp_path / "other") == 1
    assert "closes each connection: its key is another one" in capsys.readouterr().err
    assert status(*run, "--key", folder / "key", "--set", "graphics.rate=20") == 1
    assert "its scene is another one: scene graphics (" in capsys.readouterr().err
    assert status(*run, "--key", folder / "key", "--real-time", "--set", "hold=zoh") == 1
    assert "its scene is another one: scene hold (" in capsys.readouterr().err
    assert status(*run[:-1], "hand=127.0.0.1:9", "--real-time", "--key", folder / "key") == 2
    assert "hand cannot be remote in real time" in capsys.readouterr().err
    assert status(*run[:-1], "screen=127.0.0.1:9", "--key", folder / "key") == 2
    assert status(*run[:-1], "graphics=here", "--key", folder / "key") == 2
    assert "write HOST:PORT" in capsys.readouterr().err


def test_random_bytes_do_not_disturb_a_run(folder: Path, served: str, tmp_path: Path) -> None:
    host, _, port = served.rpartition(":")

    def flood() -> None:
        for i in range(200):
            with socket.create_connection((host, int(port))) as stranger:
                stranger.sendall(os.urandom(1 + 97 * i % 5000))

    thread = Thread(target=flood)
    thread.start()
    run = run_at(served, folder, tmp_path / "out", real_time=False)
    thread.join()
    assert run["fault"] is None


def test_a_server_may_start_late(tmp_path: Path) -> None:
    at = free_address()
    key_file.create(tmp_path / "key")
    arguments = ["run", "closed-loop-ideal", *SETS, "--out", tmp_path / "out", "--no-figures"]
    asked = command(*arguments, "--remote", f"graphics={at}", "--key", tmp_path / "key")
    with process(asked, tmp_path / "run.log", tmp_path) as running:
        sleep(1)
        assert running.poll() is None
        with server("closed-loop-ideal", tmp_path, *SETS, at=at):
            assert running.wait(120) == 0, (tmp_path / "run.log").read_text()


def test_a_server_that_dies_ends_the_run_by_its_policy(tmp_path: Path) -> None:
    """The haptic loop goes on with held values until faults.timeout."""
    more = "[faults]\ntimeout = 1.0\n"
    path = slow_scene(tmp_path, "if self.steps == 20: __import__('os')._exit(7)", more)
    with server(path, tmp_path, "--part", "slow") as at:
        run = hl.run(
            path, out=tmp_path / "out", figures=False, real_time=True, remote={"slow": at},
            key=tmp_path / "key",
        )  # fmt: skip
    assert f"its server at {at} has not answered within 1 s" in str(run.fault)
    told = run.run["network"]["slow"]
    assert len(told["outages"]) == 1
    assert any("held values went on" in line for line in run.run["warnings"])
    time = read_table(tmp_path / "out" / "haptics.csv")["time"]
    assert time[-1] > 1.0
    assert not left_behind()


def slow_scene(folder: Path, body: str, more: str) -> Path:
    """An FMU at 64 Hz beside one at 512 Hz, for 10 s."""
    python_fmu(folder, "One")
    python_fmu(folder, "Slow", f"self.y = time + size\n        {body}")
    fmus = fmu_table("one", "One") + fmu_table("slow", "Slow", "rate = 64\n")
    return scene(folder, fmus + more, 512, 10.0)


def test_outputs_that_are_no_numbers_are_held(tmp_path: Path) -> None:
    path = slow_scene(
        tmp_path, "if self.steps % 2: self.y = float('nan')", '[faults]\nnan = "hold"\n'
    )
    with server(path, tmp_path, "--part", "slow", "--set", "duration=1") as at:
        run = hl.run(path, ["duration=1"], figures=False, remote={"slow": at}, key=tmp_path / "key")
    assert run.fault is None
    assert run.run["held_outputs"]["slow"] == 32


def test_an_input_of_a_remote_fmu_is_converted(tmp_path: Path) -> None:
    python_fmu(tmp_path, "One")
    python_fmu(tmp_path, "Slow", "self.y = self.u")
    wire = wire_table("one.y", "slow.u", "factor = -2.0\noffset = 1.0\n")
    path = scene(tmp_path, fmu_table("one", "One") + fmu_table("slow", "Slow") + wire)
    hl.run(path, out=tmp_path / "here", figures=False)
    with server(path, tmp_path, "--part", "slow") as at:
        where = {"slow": at}
        hl.run(path, out=tmp_path / "remote", figures=False, remote=where, key=tmp_path / "key")
    here, remote = (read_table(tmp_path / o / "haptics.csv") for o in ("here", "remote"))
    assert here["slow.y"][1] == 1.0
    assert (here["slow.y"] == remote["slow.y"]).all()


def namespaces(name: str) -> tuple[list[str], list[str], str]:
    """Commands within two network namespaces that a cable joins, and why there is no netem."""
    ends = f"{name}a", f"{name}b"
    lines = [f"netns add {end}" for end in ends]
    lines.append(f"-n {ends[0]} link add cable type veth peer name cable netns {ends[1]}")
    for i, end in enumerate(ends):
        lines.append(f"-n {end} addr add 10.213.7.{i + 1}/30 dev cable")
        lines += [f"-n {end} link set {link} up" for link in ("cable", "lo")]
    for line in lines:
        subprocess.run(["ip", *line.split()], check=True, capture_output=True)
    netem = f"tc -n {ends[0]} qdisc add dev cable root netem delay 10ms 5ms loss 2% reorder 5%"
    done = subprocess.run(netem.split(), capture_output=True)
    there, here = (["ip", "netns", "exec", end] for end in ends)
    return there, here, done.stderr.decode()


@pytest.mark.parametrize("netem", [False, True], ids=["cut", "netem"])
def test_two_network_namespaces(tmp_path: Path, netem: bool) -> None:
    """With a cut of 2 s, and where the kernel has netem with delay, jitter, loss and reordering."""
    if sys.platform != "linux" or os.geteuid() or not (shutil.which("ip") and shutil.which("tc")):
        pytest.skip("network namespaces need Linux, root, and ip and tc of iproute2")
    name = f"hl{os.getpid()}"
    try:
        try:
            there, here, without = namespaces(name)
        except subprocess.CalledProcessError as error:
            pytest.skip(f"no network namespaces: {error.stderr}")
        if netem and without:
            pytest.skip(f"the kernel has no netem: {without.strip()}")
        sets, out = ["--set", "duration=6"], tmp_path / "out"
        options = [*sets, "--out", out, "--no-figures", "--real-time", "--key", tmp_path / "key"]
        with server("closed-loop-ideal", tmp_path, *sets, at="10.213.7.1:5555", before=there) as at:
            asked = command("run", "closed-loop-ideal", *options, "--remote", f"graphics={at}")
            with process([*here, *asked], tmp_path / "run.log", tmp_path) as running:
                until((out / "run.json").exists, running, tmp_path / "run.log")
                sleep(1)
                for state, pause in (("down", 2), ("up", 0)):
                    link = ["ip", "-n", f"{name}a", "link", "set", "cable", state]
                    subprocess.run(link, check=True)
                    sleep(pause)
                assert running.wait(60) == 0, (tmp_path / "run.log").read_text()
    finally:
        for side in "ab":
            subprocess.run(["ip", "netns", "del", f"{name}{side}"], capture_output=True)
    run = json.loads((out / "run.json").read_text())
    ((_, length),) = run["network"]["virtual_environment"]["outages"]
    assert length > 1.5
    assert "held values went on" in (tmp_path / "run.log").read_text()
    again = hl.run(
        "closed-loop-ideal", ["duration=6"], out=tmp_path / "again", arrivals=out, figures=False
    )
    assert again.fault is None
    assert tables(tmp_path / "again") == tables(out)
    assert not processes_of(tmp_path)


def test_ctrl_c_ends_a_run(folder: Path, served: str, tmp_path: Path) -> None:
    options = [*sets(["hold=foh", "duration=60"]), "--out", tmp_path / "out", "--real-time"]
    options += ["--remote", f"graphics={served}", "--key", folder / "key"]
    asked = command("run", "closed-loop-ideal", *options)
    with process(asked, tmp_path / "run.log", tmp_path) as running:
        until((tmp_path / "out" / "run.json").exists, running, tmp_path / "run.log")
        running.send_signal(signal.SIGINT)
        assert running.wait(60) == 1
    assert not processes_of(tmp_path)


def test_without_the_extra_the_message_says_how(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    with pytest.raises(InputFault, match=r'two computers need zmq: pip install "hapticlink'):
        key_file.require_libraries()


def test_the_port_that_the_system_chose_is_told(tmp_path: Path) -> None:
    log = tmp_path / "serve.log"
    asked = command("serve", "pendulum", "--part", "virtual_mechanism", "--key", tmp_path / "key")
    with process([*asked, "--listen", "127.0.0.1:0"], log, tmp_path) as running:
        until(lambda: "serves at" in log.read_text(), running, log)
        host, _, port = log.read_text().rpartition("serves at ")[2].strip().rpartition(":")
        assert int(port) > 0
        socket.create_connection((host, int(port)), 5.0).close()
