"""`hapticlink`: one command a file. Each imports what it needs when it is called."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from hapticlink.orchestrator.faults import Fault

app = App(
    name="hapticlink",
    help="Haptic rendering of linkages: FMUs, co-simulated at separate rates.",
    version_flags=["--version"],
)
_COMMANDS = {
    "run": "Run a scene: results, run.json and figures.",
    "build": "Build the FMUs of a scene.",
    "info": "Tell what a scene consists of, or which scenes there are.",
    "reproduce": "Make the report's figures and a page of what was found.",
}
for _name, _help in _COMMANDS.items():
    app.command(f"{__name__}.{_name}:{_name}", name=_name, help=_help)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit: 0 done, 1 the run failed (results kept), 2 bad input."""
    try:
        status = app(arguments, result_action="return_value", exit_on_error=False)
    except CycloptsError:  # cyclopts has printed it
        sys.exit(2)
    except Fault as fault:
        print(f"hapticlink: {fault}", file=sys.stderr)
        sys.exit(fault.exit_status)
    except KeyboardInterrupt:
        print("hapticlink: interrupted", file=sys.stderr)
        sys.exit(1)
    sys.exit(status or 0)
