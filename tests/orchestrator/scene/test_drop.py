"""`drop`: keys of the base scene that are not inherited."""

import re

import numpy as np
import pytest

import hapticlink as hl


def test_a_dropped_key_of_the_base_is_not_inherited(tmp_path):
    base, top = tmp_path / "base.toml", tmp_path / "top.toml"
    base.write_text('extends = "five-bar"\nholds = { "a.b" = "foh" }\nmechanism.substeps = 3\n')
    top.write_text(
        'extends = "base.toml"\ndrop = ["mechanism", "linkage.start.elbow1", "holds.\\"a.b\\""]\n'
        "[linkage.start]\nelbow1 = -1.5\n"
    )
    found = hl.scene(top)
    assert found.holds == {}
    assert found.mechanism.substeps == 1
    assert found.linkage.start["elbow1"] == -1.5
    assert found.linkage.start["shoulder1"] == pytest.approx(np.pi / 4)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('extends = "five-bar"\ndrop = ["linkag"]', "did you mean 'linkage'"),
        ('extends = "five-bar"\ndrop = ["linkage.start.elbw1"]', "did you mean 'elbow1'"),
        ('extends = "five-bar"\ndrop = ["title.x"]', "title is no table in the base scene"),
        ('extends = "five-bar"\ndrop = ["a b"]', "'a b' is no dotted key"),
        ('extends = "five-bar"\ndrop = 5', "5: write a list of dotted keys"),
        ('title = "t"\ndrop = ["linkage"]', "there is no base scene"),
    ],
)
def test_what_cannot_be_dropped_is_refused_with_its_line(lines, message, tmp_path):
    path = tmp_path / "top.toml"
    path.write_text(lines + "\n")
    with pytest.raises(hl.InputFault, match=r"line 2: drop: .*" + re.escape(message)):
        hl.scene(path)
