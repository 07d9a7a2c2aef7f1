"""The command `hapticlink`, and `python -m hapticlink`: signals are held before the
imports, and from here to the end of the process."""

import os
import signal

from hapticlink.orchestrator.base import interrupt, process


def main() -> None:
    process.open_streams()
    # Matrices of a hundred rows: threads of BLAS wait for each other, several times as long as one
    # computes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    process.raise_gc_threshold()
    with interrupt.held(interrupt.end_process, after=signal.SIG_IGN):
        from hapticlink.commands import main as command

        try:
            command()
        except SystemExit as ended:
            process.leave_threads(int(ended.code or 0))
            process.freeze_gc()
            raise


if __name__ == "__main__":
    main()
