"""Build hook: links what `.editable/hapticlink/` holds to the top-level folders.

Only editable installs need it: wheels map the folders through `sources` in pyproject.toml. What is
in `api/` are the package's own files.
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
        targets = [root / name for name in FOLDERS]
        targets += [path for path in (root / "api").iterdir() if path.is_file()]
        for target in targets:
            link = package / target.name
            if sys.platform == "win32" and target.is_file():
                link.unlink(missing_ok=True)  # git may have written a new file since
                os.link(target, link)  # a symlink needs a privilege
            elif link.exists() or link.is_symlink():
                continue
            elif sys.platform == "win32":
                command = ["cmd", "/c", "mklink", "/J", str(link), str(target)]
                subprocess.run(command, check=True)
            else:
                link.symlink_to(os.path.relpath(target, package))
