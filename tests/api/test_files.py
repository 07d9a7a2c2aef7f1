"""Building, exporting and explaining a scene from Python."""

from pathlib import Path

import pytest

import hapticlink as hl


def test_build_gives_the_file_of_each_block(bar: Path, tmp_path: Path) -> None:
    made = hl.build(bar, {"duration": 1.0}, out=tmp_path / "fmus")
    assert made == {"virtual_mechanism": tmp_path / "fmus" / "virtual_mechanism.fmu"}
    assert made["virtual_mechanism"].is_file()


def test_a_full_disk_leaves_no_part_of_an_fmu(bar: Path, tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    earlier = hl.build(bar, out=tmp_path)["virtual_mechanism"]  # it is in the cache from now on
    content = earlier.read_bytes()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(content) // 2, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            hl.build(bar, out=tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert earlier.read_bytes() == content
    assert {p.name for p in tmp_path.iterdir()} == {bar.name, earlier.name}


def test_an_exported_scene_explains_itself_as_the_scene_does(bar: Path, tmp_path: Path) -> None:
    path = hl.export(hl.scene(bar), {"haptics.rate": 100}, out=tmp_path / "bar.ssp")
    assert path == tmp_path / "bar.ssp"
    assert hl.explain(path) == hl.explain(bar, {"haptics.rate": 100})
    assert hl.explain(bar) != hl.explain(path)


@pytest.mark.parametrize(
    ("rate", "said"),
    [(30, "17.07"), (32, ""), (64, ""), ("512/16", ""), ({"min": 20, "max": 40}, "graphics is")],
)
def test_an_export_of_rates_that_do_not_divide_says_so(
    rate: object, said: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """512 / 30 = 17.07: masters with whole decimation factors step the graphics copy elsewhere."""
    hl.export("closed-loop-ideal", {"graphics.rate": rate}, out=tmp_path / "loop.ssp")
    warned = [line for line in caplog.messages if "whole multiples of the fastest rate" in line]
    assert [said in line and "at other instants" in line for line in warned] == [True] * bool(said)
    assert ("a step of graphics is" in caplog.text) == bool(said)
