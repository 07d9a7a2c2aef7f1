"""Runs jobs on a Dask cluster.

Its workers need the same version of hapticlink, and one thread each (`dask worker --nthreads 1`),
since the Python FMUs of a process share one interpreter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

from hapticlink.analysis.sweep.job import Job
from hapticlink.analysis.sweep.pool import Done
from hapticlink.analysis.sweep.row import DIED, Row, failed
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault


def on_cluster(work: Callable[[Job], Row], jobs: Sequence[Job], address: str) -> Iterator[Done]:
    """Each job with its row, as they finish. Raises InputFault without Dask, or if no scheduler
    answers at `address`."""
    try:
        from dask.distributed import Client, wait
    except ImportError:
        raise InputFault(f"--scheduler needs Dask: {install_command('distributed')}") from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        message = f"--scheduler {address}: no Dask scheduler answers there: {error}"
        raise InputFault(message) from error
    with client:
        futures = {client.submit(work, j, key=f"hapticlink-{j.key}", pure=False): j for j in jobs}
        left = set(futures)
        try:
            while left:
                interrupt.raise_if_interrupted()
                with suppress(TimeoutError):
                    wait(left, timeout=0.2, return_when="FIRST_COMPLETED")
                for future in [future for future in left if future.done()]:
                    left.remove(future)
                    try:
                        row = future.result()
                    except Exception as error:  # any failure of the cluster
                        row = failed(DIED, f"{type(error).__name__}: {error}")
                    yield futures[future], row
        finally:
            client.cancel(list(futures))
