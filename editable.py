"""Build hook: links `.editable/hapticlink/<folder>` to the top-level folders.

Only editable installs need it: wheels map the folders through `sources` in pyproject.toml.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDERS = ("components", "fmus", "orchestrator", "scenes")


class EditableLinks(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version != "editable":
            return
        root = Path(self.root)
        package = root / ".editable" / "hapticlink"
        package.mkdir(parents=True, exist_ok=True)
        for name in FOLDERS:
            link = package / name
            if link.exists() or link.is_symlink():
                continue
            if sys.platform == "win32":  # a junction needs no privilege, a symlink does
                command = ["cmd", "/c", "mklink", "/J", str(link), str(root / name)]
                subprocess.run(command, check=True)
            else:
                link.symlink_to(os.path.relpath(root / name, package))
