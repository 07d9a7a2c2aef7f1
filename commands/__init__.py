"""The command line `hapticlink`, one command a file, imported when it is called."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from hapticlink.components.registry import Registry, no_function
from hapticlink.orchestrator.base import interrupt, plugins, temporary_folders
from hapticlink.orchestrator.base.errors import (
    Fault,
    InputFault,
    Interrupted,
    describe_memory_error,
    describe_os_error,
)
from hapticlink.orchestrator.base.terminal_output import say

app = App(
    name="hapticlink",
    help="Haptic rendering of linkages: FMUs, co-simulated at separate rates.",
    help_format="markdown",
    version_flags=["--version"],
)
app.suppress_keyboard_interrupt = app.meta.suppress_keyboard_interrupt = False
"""An Interrupted has a message and a status of its own."""
COMMANDS: Registry[str | Callable[..., Any]] = Registry(
    "command",
    {
        "run": "Run a scene: results, run.json and figures.",
        "serve": "Serve FMUs of a scene to a run on another computer.",
        "view": "Drag a scene's mechanism on a page, in real time, or replay a run.",
        "new": "Write a commented scene of your own to change.",
        "compare": "Tabulate what differs between runs, and draw them over each other.",
        "report": "Write a page of a run, or of several beside each other.",
        "build": "Build the FMUs of a scene.",
        "export": "Write a scene as an SSP: its FMUs, connections, rates and holds.",
        "info": "Describe a scene, or list the shipped scenes.",
        "schema": "Print the keys of a scene, as a JSON schema or as a page.",
        "stability": "Analyse the stability of a scene by its linearised map over a period.",
        "advise": "Find the hold and the gains that suit a scene.",
        "transparency": "Compare what the hand meets with the mechanism that it should meet.",
        "fit": "Fit a device, and the arm that holds it, to a log of encoders and forces.",
        "trial": "Let somebody feel settings blindly, and find what can be told apart.",
        "tune": "Find gains up to a margin of stability, at the start pose and at a contact.",
        "sweep": "Run many variants of a scene in parallel: one table and figure.",
        "study": "Study which hold suits which rate: tables, figures and a page.",
        "bench": "Measure run time against error, beside other codes.",
        "doctor": "Report versions and optional packages, and check that FMUs build and run.",
        "recover": "Write the CSVs of a run that was killed.",
        "reproduce": "Reproduce the report's figures, with a page of the findings.",
    },
    no_function,
)
"""For each command, the help of a function in the file of that name, which is imported when it is
called; or a function itself. Its arguments and docstring define the command, and it returns the
exit status."""

GONE = {
    "advise --draws": "there are eight; --seed N gives eight others",
    "export-results": "a table of a run writes itself in Python: "
    'hl.load("runs/closed-loop").frame("haptics").to_parquet("haptics.parquet")',
}
"""Commands and options of earlier versions, with what does their work now."""

Plugin = Annotated[
    list[str] | None,
    Parameter(
        name="--plugin",
        consume_multiple=False,
        negative="",
        help="Module with parts of your own, installed or in this folder; repeatable.",
    ),
]
COMPLETION = "--install-completion"
Tokens = Annotated[str, Parameter(show=False, allow_leading_hyphen=True)]


@app.meta.default
def _command(*tokens: Tokens, plugin: Plugin = None) -> int | None:
    """Runs a command; `_commands` has loaded the plugins before."""
    return app(tokens, result_action="return_value", exit_on_error=False)


def _commands(arguments: Sequence[str]) -> None:
    """Loads the plugins named in the arguments and registers all commands; installed plugins are
    loaded if the command is not known otherwise."""
    named, words, rest = [], [], iter(arguments)
    for each in rest:
        if each == "--plugin":
            named.append(next(rest, ""))
        elif each.startswith("--plugin="):
            named.append(each.partition("=")[2])
        elif not each.startswith("-"):
            words.append(each)
    plugins.load(filter(None, named))
    options = {each.partition("=")[0] for each in arguments if each.startswith("--")}
    for gone, remedy in GONE.items():
        name, *option = gone.split()
        if words[:1] == [name] and options.issuperset(option):
            what = "option" if option else "command"
            raise InputFault(f"there is no {what} {gone} any more: {remedy}")
    if not words or words[0] not in COMMANDS:
        _register_completion()
    if words and words[0] not in COMMANDS:
        plugins.load_installed()
    for name, command in COMMANDS.items():
        if name in app:
            continue
        if isinstance(command, str):
            # The list of commands uses this line, without an import; a command's own help is its
            # docstring.
            line = None if words[:1] == [name] else command
            file = name.replace("-", "_")
            app.command(f"{__name__}.{file}:{file}", name=name, help=line)
        else:
            app.command(command, name=name)


def _register_completion() -> None:
    """Adds the option that writes the script of the shell, which takes as long to load as a
    command: for the list of commands, and where it may be given."""
    if COMPLETION not in app:
        app.register_install_completion_command(
            name=COMPLETION,
            add_to_startup=False,  # nobody has asked for a change of ~/.bashrc
            help="Write the script that completes commands, options, scenes and keys in your "
            "shell.",
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit: 0 done, 1 the run failed (results kept), 2 bad input."""
    with interrupt.defer_signals(interrupt.end_process):
        temporary_folders.clear()
        try:
            sys.exit(_status(arguments))
        finally:
            temporary_folders.clear()  # of processes of its own that have crashed


def _status(arguments: Sequence[str] | None) -> int:
    try:
        interrupt.raise_if_interrupted()
        _require_directory()
        given = sys.argv[1:] if arguments is None else list(arguments)
        for each in given:
            _require_unicode(each)
        _commands(given)
        status = app.meta(given, result_action="return_value", exit_on_error=False)
        sys.stdout.flush()
        return status or 0
    except CycloptsError:  # cyclopts has printed it
        return 2
    except (Fault, Interrupted) as fault:
        say(f"hapticlink: {fault}", file=sys.stderr)
        return fault.exit_status
    except BrokenPipeError:  # the reader has closed the pipe, such as `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # a full disk, a folder that may not be written
        told = describe_os_error(error, error.filename) if error.filename else error
        say(f"hapticlink: {told}", file=sys.stderr)
        return 1
    except MemoryError as error:
        say(f"hapticlink: {describe_memory_error(error)}", file=sys.stderr)
        return 1
    except Exception as error:
        if message := plugins.blame_plugin(error):
            say(f"hapticlink: {message}", file=sys.stderr)
            return InputFault.exit_status
        if isinstance(error, ModuleNotFoundError) and error.name != "hapticlink":
            say(
                f"hapticlink: {error}: `hapticlink doctor` reports what is missing", file=sys.stderr
            )
            return 1
        from hapticlink.commands import internal_error  # slow to load

        say(f"hapticlink: {internal_error.report_error(error)}", file=sys.stderr)
        return 1


def _require_directory() -> None:
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputFault("the current directory has been deleted: go to another one") from None


def _require_unicode(argument: str) -> None:
    try:
        argument.encode()
    except UnicodeEncodeError:
        raise InputFault(
            f"argument {argument[:100]!a}: no text in this terminal's encoding; name "
            "files and write values in UTF-8"
        ) from None
