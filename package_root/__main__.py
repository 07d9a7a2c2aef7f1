"""The command `hapticlink`, and `python -m hapticlink`: signals are held before the
imports, and from here to the end of the process."""

import signal

from hapticlink.orchestrator.base import interrupt, process


def main() -> None:
    process.open_streams()
    process.raise_gc_threshold()
    with interrupt.defer_signals(interrupt.end_process, after=signal.SIG_IGN):
        from hapticlink.commands import main as command

        try:
            command()
        except SystemExit as ended:
            process.leave_threads(int(ended.code or 0))
            process.freeze_gc()
            raise


if __name__ == "__main__":
    main()
