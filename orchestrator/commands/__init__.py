"""`hapticlink`: one command a file. Each imports what it needs when it is called."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.faults import Fault

app = App(
    name="hapticlink",
    help="Haptic rendering of linkages: FMUs, co-simulated at separate rates.",
    version_flags=["--version"],
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
    with interrupt.held(interrupt.end_process):
        temporary_folders.clear()
        try:
            sys.exit(_status(arguments))
        finally:
            temporary_folders.clear()  # of processes of its own that have crashed


def _status(arguments: Sequence[str] | None) -> int:
    try:
        interrupt.check()
        status = app(arguments, result_action="return_value", exit_on_error=False)
        sys.stdout.flush()
        return status or 0
    except CycloptsError:  # cyclopts has printed it
        return 2
    except Fault as fault:
        print(f"hapticlink: {fault}", file=sys.stderr)
        return fault.exit_status
    except BrokenPipeError:  # whoever reads has enough, as `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # a full disk, a folder that may not be written
        print(f"hapticlink: {error}", file=sys.stderr)
        return 1
