"""The command `hapticlink`, and `python -m hapticlink`: signals are held before the
imports, and from here to the end of the process."""

import os
import signal

from hapticlink.orchestrator.base import cycle_search, interrupt, standard_streams


def main() -> None:
    standard_streams.ensure()
    # Matrices of a hundred rows: threads of BLAS wait for each other, several times as long as one
    # computes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cycle_search.seldom()
    with interrupt.held(interrupt.end_process, after=signal.SIG_IGN):
        from hapticlink.commands import main as command
        from hapticlink.orchestrator.base.process_end import leave_threads

        try:
            command()
        except SystemExit as ended:
            leave_threads(int(ended.code or 0))
            cycle_search.none_of_these()
            raise


if __name__ == "__main__":
    main()
