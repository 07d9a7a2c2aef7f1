"""What all processes of a sweep need, computed once in the server of which they are forks: imports,
the compiled loop, and the hash of the sources."""

from contextlib import suppress

from hapticlink.analysis.sweep import job, run_sweep
from hapticlink.orchestrator.base import plugins
from hapticlink.orchestrator.run.compiled import library

plugins.load_installed()
job.computed_with()
with suppress(library.Unavailable):
    library.load()

__all__ = ["run_sweep"]
