"""The FMUs that packages of PyPI and repositories of GitHub bring: those of foreign_packages.txt by
pip, each file known by its sha256, and those of foreign_repositories.txt by git, at one commit."""

from __future__ import annotations

import hashlib
import importlib.util
import io
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from hapticlink.orchestrator.fmi.description import INTERFACES

HERE = Path(__file__).parent
PACKAGES = HERE / "foreign_packages.txt"
REPOSITORIES = HERE / "foreign_repositories.txt"
LIBRARIES = HERE / "foreign_libraries.txt"


@dataclass(frozen=True)
class ForeignFmu:
    """An FMU in a package or repository."""

    package: str
    """Name and version, or the first digits of the commit."""
    file: str
    """Its path there."""
    tool: str
    """generationTool of its modelDescription.xml."""
    fmi: str
    """fmiVersion of its modelDescription.xml."""
    path: Path
    """Where it has been copied to."""
    interfaces: tuple[str, ...]
    """Those of co-simulation and model exchange that it has; "" of one without."""


def pip(*options: str) -> None:
    """Runs pip: of this Python, or else the one on the PATH, for this Python's version."""
    if importlib.util.find_spec("pip"):
        command = [sys.executable, "-m", "pip"]
    elif found := shutil.which("pip"):
        command = [found]
    else:
        raise RuntimeError("pip is needed to get the packages that bring FMUs: install pip")
    subprocess.run([*command, *options], check=True, stdout=subprocess.DEVNULL)


def download_packages(folder: Path) -> list[Path]:
    """The files of the packages, those that are in `folder` already not again.

    pip asks a source distribution for its name and version, for which it may run its setup.py."""
    wanted = _lines(PACKAGES)
    hashes = [line.rpartition("sha256:")[2] for line in wanted]
    if missing := [w for w, sha in zip(wanted, hashes, strict=True) if sha not in _files(folder)]:
        (folder / "missing.txt").write_text("\n".join(missing))
        pip(
            "download", "--quiet", "--no-deps", "--ignore-requires-python", "--require-hashes",
            "--dest", str(folder), "--requirement", str(folder / "missing.txt"),
        )  # fmt: skip
    there = _files(folder)
    return [there[sha] for sha in hashes]


def _files(folder: Path) -> dict[str, Path]:
    """By sha256."""
    return {hashlib.sha256(p.read_bytes()).hexdigest(): p for p in folder.iterdir() if p.is_file()}


def install_libraries(folder: Path) -> None:
    """What Python FMUs import and do not bring, into `folder`."""
    if not folder.exists():
        pip(
            "install", "--quiet", "--no-deps", "--ignore-requires-python", "--require-hashes",
            "--target", str(folder), "--requirement", str(LIBRARIES),
        )  # fmt: skip


def find_fmus(folder: Path) -> Iterator[ForeignFmu]:
    """The FMUs of all packages and repositories, copied to `folder / "fmus"`."""
    for archive in download_packages(folder):
        package = re.sub(r"(\.tar\.gz|-py3-.*)$", "", archive.name).replace("_", "-").lower()
        package = " ".join(package.rpartition("-")[::2])
        yield from _copy_fmus(package, _members(archive), folder / "fmus")
    for repository, commit, *paths in map(str.split, _lines(REPOSITORIES)):
        members = _fetch_files(folder / "repository", repository, commit, paths)
        yield from _copy_fmus(f"{repository} {commit[:7]}", members, folder / "fmus")


def _lines(path: Path) -> list[str]:
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


def _fetch_files(
    copy: Path, repository: str, commit: str, paths: list[str]
) -> Iterator[tuple[str, bytes]]:
    """The FMUs in the named folders of a repository; of the others nothing is fetched."""

    def git(*options: str) -> bytes:
        command = ["git", "-C", str(copy), *options]
        return subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout

    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    git("init", "--quiet")
    git("remote", "add", "origin", f"https://github.com/{repository}")
    git("fetch", "--quiet", "--depth", "1", "--filter=blob:none", "origin", commit)
    names = git("ls-tree", "-r", "--name-only", commit, *paths).decode().splitlines()
    for name in names:
        if name.endswith(".fmu"):
            yield name, git("show", f"{commit}:{name}")
    shutil.rmtree(copy)


def _copy_fmus(
    package: str, members: Iterable[tuple[str, bytes]], folder: Path
) -> Iterator[ForeignFmu]:
    for file, content in sorted(members):
        with zipfile.ZipFile(io.BytesIO(content)) as fmu:
            root = ElementTree.fromstring(fmu.read("modelDescription.xml"))
        path = folder / hashlib.sha256(content).hexdigest()[:16] / Path(file).name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        tool = " ".join(root.get("generationTool", "").split())
        has = tuple(n for n, tag in INTERFACES.items() if root.find(tag) is not None)
        kinds = has or ("",)
        yield ForeignFmu(package, file, tool, root.get("fmiVersion", ""), path, kinds)


def _members(archive: Path) -> Iterator[tuple[str, bytes]]:
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            names = [name for name in wheel.namelist() if name.endswith(".fmu")]
            yield from ((name, wheel.read(name)) for name in names)
        return
    with tarfile.open(archive) as files:
        for member in files:
            if member.name.endswith(".fmu") and (file := files.extractfile(member)):
                yield member.name.partition("/")[2], file.read()
