"""What the functions of `hl` refuse before anything runs: a row is a call, with a scene of one bar
and an empty folder, and what the message says of place, value and remedy."""

from collections.abc import Callable
from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.analysis.sweep.grid import points
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene

DEVICE = 'title = "A device"\nduration = 1.0\n[device]\n'


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


REFUSED: list[tuple[Callable[[Path, Path], object], str]] = [
    # files
    (lambda bar, out: hl.build(bar, out=out, all_platforms=True), "packaging=native"),
    (lambda bar, out: hl.build(bar, out=out, fmi=3),
     "--fmi 3 compiles: add --set packaging=native"),
    (lambda bar, out: hl.build(bar, out=out, as_one=True, fmi=4), "--fmi: 4 is not 2 or 3"),
    (lambda bar, out: hl.export(bar, out=out), r"is a folder; name a file in it, .*scene\.ssp"),
    (lambda bar, out: hl.load(out), "not the folder of a run"),
    (lambda bar, out: hl.load(written(out / "run.json", "{}").parent),
     r"run\.json: scene: field required: run the"),
    # sweeps
    (lambda bar, out: points({"a.b": 3}, ()), "a.b: 3 is one value; give a list"),
    (lambda bar, out: points("a.b=1,2", ()),
     "vary 'a.b=1,2': give a mapping, or a list of key=values"),
    (lambda bar, out: points({"a.b": []}, ()), "a.b: no value"),
    (lambda bar, out: points([1], ()), "vary: give"),
    (lambda bar, out: points({}, ()), "give either --vary"),
    (lambda bar, out: points(["a=1"], [{"a": 1}]), "give either --vary"),
    (lambda bar, out: points((), range(3)), "runs: give"),
    (lambda bar, out: hl.sweep(bar, {"hold": ["a", "b"]}), "no hold 'a'"),
    (lambda bar, out: hl.sweep(bar, {"duration": [0.1]}, jobs=0), "jobs 0: give 1 or more"),
    # what is shown
    (lambda bar, out: load_viewed_scene(str(written(out / "device.toml", DEVICE))),
     r"device.toml: has no \[linkage\].*closed-loop"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), REFUSED)
def test_what_is_refused(call, message, bar, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    with pytest.raises(hl.InputFault, match=message):
        call(bar, folder)
