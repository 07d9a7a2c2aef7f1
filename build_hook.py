"""Build hook: compiles the event loop, and links what editable installs import.

A wheel is for this machine, or for the platform that the environment variable HAPTICLINK_WHEEL
names by its tag (WHEELS in orchestrator/run/compiled/build.py).

Wheels map the top-level folders through `sources` in pyproject.toml. For an editable install
`.editable/hapticlink/` gets links to them, and to the package's own files, which are in
`package_root/`.
"""

import os
import runpy
import subprocess
import sys
import sysconfig
import tempfile
from contextlib import suppress
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDERS = (
    "components", "fmus", "orchestrator", "programs", "analysis", "visualization", "api",
    "commands", "scenes",
)  # fmt: skip
LOOP = Path("orchestrator", "run", "compiled")


class Build(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel":
            return
        if version == "editable":
            for older in Path(self.root, LOOP).glob("loop-*"):
                older.unlink()
            self._compiled(Path(self.root, LOOP))
            self._link()
            return
        self._room = tempfile.TemporaryDirectory()  # `finalize` removes it: nothing is left here
        tag = os.environ.get("HAPTICLINK_WHEEL")
        if library := self._compiled(Path(self._room.name), tag):
            build_data["force_include"][str(library)] = str(Path("hapticlink", LOOP, library.name))
            build_data["pure_python"] = False
            here = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            build_data["tag"] = f"py3-none-{tag or self._build['this_machine']() or here}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if self.target_name == "wheel" and version != "editable":
            self._room.cleanup()
            cached = Path(cache_from_source(__file__))  # of this module, in the checkout
            cached.unlink(missing_ok=True)
            with suppress(OSError):  # there are others
                cached.parent.rmdir()

    def _compiled(self, folder: Path, tag: str | None = None) -> Path | None:
        """The compiled loop, in `folder`; None where it cannot be compiled here. It is then
        compiled at its first use. Raises ValueError for an unknown `tag`."""
        self._build = build = runpy.run_path(str(Path(self.root, LOOP, "build.py")))
        if tag and tag not in build["WHEELS"]:
            raise ValueError(f"HAPTICLINK_WHEEL={tag}: there are {', '.join(build['WHEELS'])}")
        library = folder / build["name"](tag)
        try:
            build["compile_loop"](library, build["zig"](tag))
        except (subprocess.CalledProcessError, OSError) as error:
            message = getattr(error, "stderr", None) or str(error).encode()
            self.app.display_warning(f"no compiled loop: {message.decode(errors='replace')}")
            return None
        return library

    def _link(self) -> None:
        root = Path(self.root)
        package = root / ".editable" / "hapticlink"
        package.mkdir(parents=True, exist_ok=True)
        targets = [root / name for name in FOLDERS]
        targets += [path for path in (root / "package_root").iterdir() if path.is_file()]
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
