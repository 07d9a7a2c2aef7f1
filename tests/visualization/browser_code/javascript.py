"""Modules of the page under node; without it the tests that need it are skipped."""

import json
import shutil
import subprocess
from typing import Any

import pytest

from hapticlink.visualization.browser_code import one_file

NODE = shutil.which("node")


def javascript(module: str, statements: str, given: Any) -> Any:
    """`answer` after `statements` that follow a module of the page; `given` is what they are
    given."""
    if not NODE:
        pytest.skip("node is not installed")
    begin = f"let answer;\nconst given = {json.dumps(given)};\n{one_file.bundle(module)}"
    whole = f"{begin}\n{statements}\nconsole.log(JSON.stringify(answer));"
    done = subprocess.run(
        [NODE, "--input-type=module", "-"], input=whole, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
