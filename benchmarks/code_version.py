"""The version of the code that finished rows belong to; rows of another one are measured again."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

import benchmarks
import hapticlink.analysis
import hapticlink.components
import hapticlink.fmus
import hapticlink.fmus.native
import hapticlink.orchestrator
import hapticlink.programs
import hapticlink.scenes
from hapticlink.fmus.cache import sources
from hapticlink.fmus.versions import find_versions

PACKAGES = (
    "hapticlink", "casadi", "ziglang", "numpy", "scipy", "mujoco", "pin", "exudyn", "drake",
    "fmpy", "pythonfmu", "libcosimpy", "ecospy",
)  # fmt: skip
"""Those that take part, of which some need not be installed."""


def begin(out: Path, rows: tuple[str, ...], *further: ModuleType) -> None:
    """Keep the files `rows` in `out` only if they were made by these sources, those of the packages
    `further` among them, and versions."""
    path = out / "state.json"
    made_by = sources(hapticlink.components, hapticlink.fmus.native, benchmarks, *further)
    now = {"sources": made_by, "versions": find_versions(PACKAGES)}
    if not path.exists() or json.loads(path.read_text()) != now:
        for name in rows:
            (out / name).unlink(missing_ok=True)
        path.write_text(json.dumps(now, indent=1) + "\n")


MEASURED = (
    hapticlink.components, hapticlink.fmus, hapticlink.orchestrator, hapticlink.programs,
    hapticlink.analysis, hapticlink.scenes, benchmarks,
)  # fmt: skip
MADE = re.compile(r"^Made from commit .*\n\n?", re.MULTILINE)
MADE_FROM = "made_from.json"
"""In results/: of each benchmark the commit of its tables, and the hashes of its packages."""


def sign(results: Path, what: str, page: Path) -> None:
    """Record what code the tables of a benchmark were just made from, and say it on their page."""
    git = ("git", "-C", str(Path(__file__).parent))
    named = subprocess.run(
        (*git, "describe", "--always"), capture_output=True, text=True, check=False
    )
    commit = named.stdout.strip()
    places = (":/", ":!/results")  # where pages are just written
    changed = subprocess.run((*git, "diff", "--quiet", "HEAD", "--", *places), check=False)
    if commit and changed.returncode:
        commit += "-dirty"
    path = results / MADE_FROM
    record = json.loads(path.read_text()) if path.exists() else {}
    record[what] = {"commit": commit, "sources": _hashes()}
    path.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
    _mark(page, f"commit {commit}.")


def status(results: Path, pages: Mapping[str, Path]) -> Iterator[str]:
    """A line for each benchmark, by its page: whether its tables are those of the code that is
    there. Pages of others say so below their title."""
    for what, commit, since in _find_changes(results, pages):
        if pages[what].exists():
            _mark(pages[what], f"commit {commit}{since}.")
        yield f"{what}: made from commit {commit}{since or ', current'}"


def stale(results: Path, pages: Mapping[str, Path]) -> Iterator[str]:
    """The lines of `status` on benchmarks that have a page of tables of other code; writes
    nothing."""
    for what, commit, since in _find_changes(results, pages):
        if since and pages[what].exists():
            yield f"{what}: made from commit {commit}{since}"


def _find_changes(results: Path, whats: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Each benchmark with the commit of its tables, and what changed since then, "" for nothing."""
    path, now = results / MADE_FROM, _hashes()
    record = json.loads(path.read_text()) if path.exists() else {}
    for what in whats:
        made = record.get(what, {"commit": "unknown", "sources": {}})
        changed = [name for name, sha in now.items() if made["sources"].get(name) != sha]
        yield what, made["commit"], f"; changed since then: {', '.join(changed)}" * bool(changed)


def _mark(page: Path, made_from: str) -> None:
    """Write below the title of a page what it was made from, in the place of what stood there."""
    text = MADE.sub("", page.read_text(encoding="utf-8"))
    title, _, body = text.partition("\n")
    page.write_text(
        f"{title}\n\nMade from {made_from}\n\n{body.strip()}".rstrip() + "\n", encoding="utf-8"
    )


def _hashes() -> dict[str, str]:
    return {package.__name__.rpartition(".")[2]: sources(package)[:16] for package in MEASURED}
