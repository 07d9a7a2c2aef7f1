"""What a page and an animation show of recorded runs, beside their tables."""

import json
import re
import shutil
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import hapticlink as hl
from hapticlink.analysis.findings.episodes import episodes
from hapticlink.visualization.replay import animation, recorded_frames, replay_page
from hapticlink.visualization.replay.recorded_frames import Recorded
from hapticlink.visualization.replay.serve import serve_page

LINK = 0.042
"""Length (m) of link 1 of Table 6.1, which turns about the origin."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "run"
    hl.run("closed-loop-ideal", {"duration": 0.5}, out=out, figures=False)
    return out


def test_frames_have_the_poses_of_the_table(folder: Path) -> None:
    r, frames = hl.load(folder), Recorded(str(folder)).frames()
    q = r["virtual_mechanism.q"]
    assert len(frames) == len(q)
    ends = np.array([f["poses"]["link2"] for f in frames])
    assert ends[:, 0] == pytest.approx(LINK * np.cos(q[:, 0]), abs=1e-9)
    assert ends[:, 1] == pytest.approx(LINK * np.sin(q[:, 0]), abs=1e-9)
    assert ends[:, 2] == pytest.approx(q[:, 0] + q[:, 1], abs=1e-9)


def test_a_slower_signal_has_its_newest_sample(folder: Path) -> None:
    r, run = hl.load(folder), Recorded(str(folder))
    ghost, stamps = r["virtual_environment.q"], r.time("virtual_environment.q")
    found = run.values()["ghost"]
    for i, t in enumerate(run.times):
        assert found[i] == pytest.approx(ghost[stamps <= t + 1e-9][-1])


def test_the_page_has_the_frames_to_seven_digits(folder: Path) -> None:
    run = Recorded(str(folder))
    told = told_by(replay_page.html([run]))["runs"][0]
    frames = run.frames()
    for key, column in told["frames"].items():
        expected, at = [frame.get(key) for frame in frames], [*column["at"], len(frames)]
        for value, first, after in zip(column["is"], at[:-1], at[1:], strict=True):
            for frame in (expected[first], expected[after - 1]):
                assert flat(value) == pytest.approx(flat(frame), rel=1e-6, abs=1e-12), key


def told_by(html: str) -> dict[str, Any]:
    found = re.search(r'id="data">(.*?)</script>', html, re.DOTALL)
    assert found
    return json.loads(found[1])


def flat(value: Any) -> list[float]:
    if isinstance(value, str):
        return [float(ord(letter)) for letter in value]
    if isinstance(value, dict):
        return flat([*value.values()])
    return [x for each in value for x in flat(each)] if isinstance(value, list) else [value]


def test_a_long_run_is_thinned_and_says_so(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_frames, "MAX_FRAMES", 100)
    run = Recorded(str(folder))
    assert len(run.times) <= 100
    assert run.message()["every"] == 3


def test_signals_that_are_not_recorded_are_named_and_nothing_stands_in_for_them(
    tmp_path: Path,
) -> None:
    kept = ["virtual_mechanism.q", "virtual_mechanism.x", "controller.F_drift"]
    hl.run(
        "closed-loop-ideal", {"duration": 0.1, "record.signals": kept}, out=tmp_path, figures=False
    )
    run = Recorded(str(tmp_path))
    assert {"haptic_device.x_true", "hand.F", "virtual_environment.q"} <= {*run.missing}
    (frame, *_) = run.frames()
    assert not {"handle", "arms", "F_hand", "ghost"} & {*frame}


def test_the_picture_of_a_frame_marks_what_the_episodes_of_its_run_have(tmp_path: Path) -> None:
    options = {"graphics.rate": 10, "controller.topology": False, "device.motor.torque_limit": 0.02}
    hl.run("closed-loop-ideal", options, out=tmp_path, figures=False)
    run = Recorded(str(tmp_path))
    marked = [(t, f["states"]) for t, f in zip(run.times, run.frames(), strict=True)]
    for kind in ("saturated", "energy"):
        spans = [e for e in episodes(run.results) if e.kind == kind]
        expected = [any(e.begin <= t < e.end for e in spans) for t, _ in marked]
        assert [kind in states for _, states in marked][:-1] == expected[:-1]
        assert 0 < sum(expected) < len(expected)


Change = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda run: run.clear(), "scene: field required"),
        (lambda run: run.pop("fmus"), "fmus: field required"),
        (lambda run: run.update(end=3), "end: input should be a valid dictionary"),
        (lambda run: run["scene"].update(linkage=None), r"no \[linkage\]"),
        (lambda run: run["scene"].pop("device"), "scene.device is missing"),
        (lambda run: run["scene"]["linkage"].update(body=3), "scene.linkage body"),
        (lambda run: run["scene"]["linkage"].update(joint=[]), "virtual_mechanism.q is not"),
        (lambda run: run.update(fmus={}), "virtual_mechanism.q is not recorded"),
        (lambda run: run.update(files=["none.csv"], rates=["none"]), "none.csv"),
    ],
)
def test_a_malformed_folder_is_bad_input(
    folder: Path, tmp_path: Path, change: Change, said: str
) -> None:
    shutil.copytree(folder, tmp_path / "run")
    run = json.loads((folder / "run.json").read_text())
    change(run)
    (tmp_path / "run" / "run.json").write_text(json.dumps(run))
    with pytest.raises(hl.InputFault, match=said):
        Recorded(str(tmp_path / "run"))


def test_text_of_a_scene_cannot_end_the_data(tmp_path: Path) -> None:
    title = "</script><script>alert(1)</script><!--"
    hl.run("closed-loop-ideal", {"duration": 0.05, "title": title}, out=tmp_path, figures=False)
    html = replay_page.html([Recorded(str(tmp_path))])
    assert html.count("<script") == html.count("</script>") == 4
    assert told_by(html)["runs"][0]["title"] == title


@pytest.mark.parametrize("ending", [".gif", ".webp", ".png"])
def test_an_animation_moves_begins_anew_and_has_the_same_bytes_each_time(
    folder: Path, tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(animation, "MAX_FRAMES", 4)
    made = [tmp_path / f"{i}{ending}" for i in (1, 2)]
    for path in made:
        replay_page.write_replay([Recorded(str(folder))], path)
    assert made[0].read_bytes() == made[1].read_bytes()
    with Image.open(made[0]) as film:
        assert film.n_frames == 4  # type: ignore[attr-defined]
        assert film.info["loop"] == 0
        first = np.array(film.convert("RGB"), int)
        film.seek(film.n_frames - 1)  # type: ignore[attr-defined]
        assert np.abs(np.array(film.convert("RGB"), int) - first).max() > 100


def test_the_page_is_served_to_who_knows_its_path_alone() -> None:
    with serve_page("<p>here</p>", "127.0.0.1", (0,), "secret") as port:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/secret/") as answer:
            assert answer.read() == b"<p>here</p>"
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        for path in ("", "secret", "other/", "secret/../secret/x"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{path}")


def test_a_run_of_two_users_has_the_handles_and_arms_of_both(tmp_path: Path) -> None:
    out = tmp_path / "two"
    hl.run("two-users", {"duration": 0.1}, out=out, figures=False)
    r, message = hl.load(out), Recorded(str(out)).message()
    assert message["users"] == ["", "left"]
    frame = Recorded(str(out)).frames()[-1]
    left = frame["others"]["left"]
    assert left["handle"] == r["haptic_device_left.x_true"][-1].tolist()
    assert left["F_env"] == r["virtual_mechanism.left.F_env"][-1].tolist()
    assert len(left["arms"]) == len(frame["arms"]) == 19
    assert left["arms"] != frame["arms"]
    assert len(left["directions"]) == left["n"][0] == 1


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_is_not_finite_is_left_out_and_told(folder: Path, tmp_path: Path) -> None:
    run = shutil.copytree(folder, tmp_path / "run")
    table = hl.load(run).tables["haptics"]
    changed = table.rows.copy()
    changed[20, table.columns.index("virtual_mechanism.q[1]")] = np.nan
    changed[30, table.columns.index("hand.F[1]")] = np.inf
    header = (run / "haptics.csv").read_text().partition("\n")[0]
    np.savetxt(run / "haptics.csv", changed, "%.17g", ",", header=header, comments="")
    found = Recorded(str(run))
    assert len(found.times) == len(changed) - 1
    told = told_by(replay_page.html([found]))["runs"][0]
    assert told["left_out"] == 1
    frames = found.frames()
    assert [i for i, frame in enumerate(frames) if "F_hand" not in frame] == [29]
