"""`hapticlink`: one command a file. Each imports what it needs when it is called."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.faults import Fault

app = App(
    name="hapticlink",
    help="Haptic rendering of linkages: FMUs, co-simulated at separate rates.",
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,  # told below, with the exit status of every other end
)
_COMMANDS = {
    "run": "Run a scene: results, run.json and figures.",
    "build": "Build the FMUs of a scene.",
    "export": "Write a scene as an SSP: its FMUs, connections, rates and holds.",
    "info": "Tell what a scene consists of, or which scenes there are.",
    "schema": "Print what a scene may say, for editors or as a page.",
    "sweep": "Run many variants of a scene in parallel: one table and figure.",
    "study": "Study which hold suits which rate: tables, figures and a page.",
    "bench": "Measure run time against error, beside other codes.",
    "reproduce": "Make the report's figures and a page of what was found.",
}
for _name, _help in _COMMANDS.items():
    app.command(f"{__name__}.{_name}:{_name}", name=_name, help=_help)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit: 0 done, 1 the run failed (results kept), 2 bad input."""
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    on_main = threading.current_thread() is threading.main_thread()
    interrupt.came.raised = False
    for number, handler in before.items():
        # SIGTERM as Ctrl-C, so that what is open is closed and temporary folders are removed.
        if on_main and handler != signal.SIG_IGN:
            signal.signal(number, interrupt.remember)
    temporary_folders.clear()
    try:
        status = app(arguments, result_action="return_value", exit_on_error=False)
        sys.stdout.flush()
    except CycloptsError:  # cyclopts has printed it
        sys.exit(2)
    except Fault as fault:
        print(f"hapticlink: {fault}", file=sys.stderr)
        sys.exit(fault.exit_status)
    except BrokenPipeError:  # whoever reads has enough, as `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:  # a full disk, a folder that may not be written
        print(f"hapticlink: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("hapticlink: interrupted", file=sys.stderr)
        sys.exit(1)
    finally:
        for number, handler in before.items():
            if on_main:
                signal.signal(number, handler)
        interrupt.came.raised = False
        temporary_folders.clear()  # of processes of its own that have crashed
    sys.exit(status or 0)
