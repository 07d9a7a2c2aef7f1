"""The command `hapticlink`, and `python -m hapticlink`: signals are held before the
imports, and from here to the end of the process."""

import gc
import os
import signal

from hapticlink.orchestrator.base import interrupt, standard_streams


def main() -> None:
    standard_streams.ensure()
    # Matrices of a hundred rows: threads of BLAS wait for each other, several times as long as one
    # computes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Modules and figures are many objects that stay: searching them for cycles takes 5 % of a run,
    # and as much again three times as the process ends.
    gc.set_threshold(200_000)
    with interrupt.held(interrupt.end_process, after=signal.SIG_IGN):
        from hapticlink.commands import main as command
        from hapticlink.orchestrator.base.process_end import leave_threads

        try:
            command()
        except SystemExit as ended:
            leave_threads(int(ended.code or 0))
            gc.freeze()
            raise


if __name__ == "__main__":
    main()
