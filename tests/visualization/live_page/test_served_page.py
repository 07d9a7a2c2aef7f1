"""The page as it is served, from the outside: who is let in, and what acts on the run."""

import http.client
import json
import socket
import sys
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

import hapticlink as hl
from tests.shared_fixtures import status
from tests.visualization.browser_code.served_page import CONSTRAINED, FREE, Served, values

HELD = "virtual_environment.Lambda_inv -> controller.Lambda_inv"


def got(served: Served, path: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=10)
    connection.request("GET", path)
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


@pytest.mark.parametrize(
    "path",
    ["/", "/index.html", "/favicon.ico", "/run", "/wrong/", "{token}page.cs", "{token}../server.py",
     "{token}%2e%2e/server.py", "{token}/etc/passwd", "/x{token}"],
)  # fmt: skip
def test_nothing_is_served_without_the_token_or_beside_the_page(served: Served, path: str) -> None:
    found, text = got(served, path.replace("{token}", served.path))
    assert found == 404
    assert "hapticlink" not in text


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_token_is_in_no_list_of_processes(served: Served) -> None:
    """Any user of a machine reads the arguments of all processes."""
    children = Path(f"/proc/{served.process.pid}/task/{served.process.pid}/children").read_text()
    assert children.split()
    for process in (served.process.pid, *children.split()):
        arguments = Path(f"/proc/{process}/cmdline").read_text()
        assert served.path.strip("/") not in arguments


def test_every_file_of_the_page_is_served(served: Served) -> None:
    assert "<canvas" in got(served, served.path)[1]
    files = (Path(hl.__file__).parent / "visualization/browser_code").iterdir()
    for file in (file for file in files if file.is_file() and file.suffix != ".py"):
        assert got(served, served.path + file.name) == (200, file.read_text())


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null"])
def test_other_origins_are_refused(served: Served, origin: str) -> None:
    with pytest.raises(InvalidStatus, match="403"), served.window(origin):
        pass


def test_the_server_listens_on_this_machine_alone(served: Served) -> None:
    others = {a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in others - {"127.0.0.1"}:
        with pytest.raises(OSError, match=r"."):
            socket.create_connection((address, served.port), 2)


def test_a_malformed_message_changes_nothing(served: Served) -> None:
    with served.window() as window:
        before = dict(window.until(lambda new: "controls" in new))
        rate = '{"type": "set", "key": "graphics.rate", "value": -1}'
        for text in ("{", rate, '{"type": "set", "key": "gains.x"}', b"\0"):
            window.newest.pop("refused", None)
            window.socket.send(text)
            window.until(lambda new: "refused" in new)
        window.newest.pop("refused")
        window.set("holds.no.such", "zoh")
        window.until(lambda new: "no.such" in new.get("refused", {}).get("why", ""))
        after = window.until(lambda new: new["frame"]["t"] > before["frame"]["t"] + 0.1)
        assert (after["controls"], after["state"]) == (before["controls"], before["state"])


def test_the_free_direction_yields_and_the_constrained_one_resists(served: Served) -> None:
    """A pull of 20 mm along each; the other direction holds against 2 N."""
    moved = {}
    for name, way in (("free", np.array(FREE)), ("constrained", np.array(CONSTRAINED))):
        with served.window() as window:
            window.until(lambda new: new["frame"]["t"] > 0.3)
            window.send(type="time", do="reset")
            start = window.until(lambda new: "state" in new and new["frame"]["t"] < 0.2)["frame"]
            x = np.array(start["x"][:2])
            window.send(type="hand", at=[*(x + 0.02 * way)])
            end = window.until(lambda new: new["frame"]["t"] > 1.5)["frame"]
            moved[name] = abs(way @ (np.array(end["x"][:2]) - x))
    assert moved["free"] == pytest.approx(0.02, rel=0.1)
    assert moved["constrained"] < 1e-6


def test_a_window_that_is_closed_lets_go_and_ends_nothing(served: Served) -> None:
    with served.window() as second:
        with served.window() as first:
            x = first.until(lambda new: "controls" in new)["frame"]["x"]
            first.send(type="hand", at=[x[0] + 0.05, x[1]])
            seen = second.until(lambda new: abs(new["frame"]["F_hand"][0]) > 1)
            second.send(type="hand", at=[x[0] - 0.05, x[1]])  # while the first has hold of it
            seen = second.until(lambda new: new["frame"]["t"] > seen["frame"]["t"] + 0.3)
            assert seen["frame"]["F_hand"][0] > 1
        time = seen["frame"]["t"]
        second.until(
            lambda new: new["frame"]["t"] > time + 0.5 and abs(new["frame"]["F_hand"][0]) < 0.5
        )


def test_every_window_sees_a_control_that_changes_the_run(served: Served) -> None:
    with served.window() as first, served.window() as second:
        first.until(lambda new: "controls" in new)
        first.set("gains.hand.damping", 2.0)
        first.set(f"holds.{HELD}", "foh")
        found = second.until(lambda new: values(new["controls"])[f"holds.{HELD}"] == "foh")
        assert values(found["controls"])["gains.hand.damping"] == 2.0


def test_time_stands_still_steps_and_goes_on(served: Served) -> None:
    with served.window() as window:
        window.send(type="time", do="pause")
        window.until(lambda new: new.get("state", {}).get("paused"))
        still = window.until(lambda new: True)["frame"]["t"]
        assert window.until(lambda new: True)["frame"]["t"] == still
        window.send(type="time", do="step")
        assert window.until(lambda new: new["frame"]["t"] > still)["frame"]["t"] == pytest.approx(
            still + 1 / 512, abs=1e-6
        )
        window.send(type="time", do="resume")
        window.until(lambda new: new["frame"]["t"] > still + 0.1)


def test_a_recording_is_a_result_folder_with_the_changes(served: Served) -> None:
    with served.window() as window:
        window.send(type="time", do="record")
        found = window.until(lambda new: new.get("state", {}).get("recording"))
        folder = served.folder / found["state"]["recording"]
        window.set("graphics.rate", 12.5)
        window.until(lambda new: values(new["controls"])["graphics.rate"] == 12.5)
        window.until(lambda new: new["frame"]["t"] > 0.5)
        window.send(type="time", do="record")
        window.until(lambda new: not new["state"]["recording"])
    made = hl.load(folder)
    assert json.loads((folder / "run.json").read_text())["real_time"]["deadlines_missed"] >= 0
    assert "rate of graphics: 12.5 Hz" in [text for _, text in made.run["real_time"]["changes"]]
    assert made.time("hand.F")[-1] > 0.4
    assert made.run["fault"] is None


def test_ctrl_c_ends_everything(tmp_path: Path) -> None:
    page = Served(tmp_path)
    with page.window() as window:
        window.until(lambda new: "controls" in new)
        assert page.end()[0] == 0
    with pytest.raises(ConnectionRefusedError), page.window():
        pass


def test_a_port_in_use_is_told(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert status("view", "closed-loop-ideal", "--no-browser", "--port", port) == 2
    assert f"--port {port}: " in capfd.readouterr().err
