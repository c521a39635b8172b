"""The command ``omnidrive``: its verbs and its exit status."""

from __future__ import annotations

import gc
import logging
import os
import sys
import warnings
from contextlib import suppress
from errno import ENOSPC, EPIPE
from importlib import import_module
from typing import Annotated, Any, TextIO

import typer
from typer.core import TyperGroup

from omnidrive.cli.compile_status import show_compiling
from omnidrive.cli.terminal import NoteHandler, encodable, note, quiet_option
from omnidrive.errors import OmnidriveError, RunFailed, WorkerLost
from omnidrive_command import check_interrupted, main

__all__ = ["VERBS", "app", "load_verb", "main", "run"]

VERBS = {
    "compare": "Run a whole study: plan, simulate every controller, evaluate, report.",
    "study": "Vary anything in a scenario; show the differences and their uncertainty.",
    "plan": "Search, smooth and time a path, and report its use of the robot's limits.",
    "run": "Simulate one controller in one task; write metrics, time series, figures and report.",
    "drive": "Drive a robot in real time: a simulated one, or a real one over a link.",
    "log": "Show, export, replay and compare logs of drives.",
    "tune": "Search for better parameters of a controller, and measure the gain on other runs.",
    "robot": "Show, import and identify robots.",
    "ros2": "Drive or simulate a robot in a ROS 2 graph, and examine the graph.",
    "list": "List controllers, plants, robots, maps, estimators, references and links.",
    "new": "Write a commented, runnable file with a controller, plant or robot of your own.",
    "warmup": "Compile all numerical kernels in advance.",
    "schema": "Print the JSON schema of scenario or robot files, for editors.",
    "fuzzy": "Show, convert and evaluate fuzzy systems in files: .fis, .fll, .fcl, .fml.",
}
"""Verbs, each with a module of the same name, and the first line of their help."""

_FOLDERS = {
    **dict.fromkeys(("compare", "study", "run", "tune"), "studies."),
    **dict.fromkeys(("drive", "log", "ros2"), "drives."),
    "robot": "robots.",
    "fuzzy": "fuzzy_systems.",
}
"""Folder of the module of a verb in this package; the others are in the package itself."""


class _LazyVerbs(TyperGroup):
    """Verbs whose modules are imported on use, so that ``--help`` is fast."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[Any, Any, list[str]]:
        """Resolve the verb and import its module."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command and load_verb(command.name or ""), rest


def load_verb(name: str) -> Any:
    """Import the module of a verb and return its command."""
    verb = getattr(import_module(f"omnidrive.cli.{_FOLDERS.get(name, '')}{name}"), name)
    if not isinstance(verb, typer.Typer):
        wrapper = typer.Typer(add_completion=False, rich_markup_mode="markdown")
        wrapper.command()(verb)
        verb = wrapper
    command: Any = typer.main.get_command(verb)
    for each in getattr(command, "commands", {"": command}).values():
        each.params.append(quiet_option())
    return command


app = typer.Typer(
    name="omnidrive",
    cls=_LazyVerbs,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _name, _help in VERBS.items():
    app.command(_name, help=_help)(lambda: None)


def _print_version(requested: bool) -> bool:
    if requested:
        from importlib.metadata import version

        typer.echo(f"omnidrive {version('omnidrive')}")
        raise typer.Exit
    return requested


@app.callback()
def omnidrive(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Plan, track, simulate and compare trajectory tracking of omnidirectional robots.

    Start with **omnidrive compare**: it simulates the reference study and writes a report.

    Units: metres, seconds, radians; headings counter-clockwise from the x axis of the map.

    Output: a folder for results must be new or empty; files of robots, fuzzy systems and tables are
    replaced with `--force` only; figures, videos and planned motions are replaced.

    Exit status: 0 success; 1 a run failed, or an internal error of omnidrive; 2 invalid options or
    input, or output that cannot be written; 130 interrupted; 128 + n terminated by signal n.
    """


_COLLECTED = 50_000  # objects from which garbage is collected

_STREAMS = {"stdout": 1, "stderr": 2}


def _open_streams() -> None:
    """Open the null device as each standard stream that is closed, as after ``2>&-``.

    The next file that is opened would otherwise get the stream's number, and what libraries print.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= _STREAMS["stderr"]:
        os.set_inheritable(number, True)
    os.close(number)
    for name, number in _STREAMS.items():
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "w", encoding="utf-8"))  # noqa: SIM115 - until the end


def _note(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning for users as a note."""
    if issubclass(category, FutureWarning):
        note(str(message))


def run() -> int:
    """Run the command and return its exit status; an error is printed as one paragraph."""
    _open_streams()
    gc.set_threshold(_COLLECTED)  # imports and tables are no garbage; searching them takes seconds
    logging.getLogger().addHandler(NoteHandler(logging.WARNING))
    show_compiling()
    with warnings.catch_warnings():
        warnings.simplefilter("always", FutureWarning)
        warnings.showwarning = _note
        try:
            return int(app(prog_name="omnidrive", standalone_mode=False) or 0)
        except Exception as error:
            check_interrupted()  # the error may be a consequence
            return _handle(error)


def _handle(error: Exception) -> int:
    """Print the message of an error and return the exit status."""
    if isinstance(error, typer.exceptions.TyperException):  # invalid options
        error.show() if hasattr(error, "show") else _print_error(str(error))
        return int(error.exit_code)
    if isinstance(error, OmnidriveError):
        _print_error(str(error))
        return 1 if isinstance(error, RunFailed | WorkerLost) else 2
    if isinstance(error, OSError) and error.errno in {EPIPE, ENOSPC}:  # of standard output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == ENOSPC:  # with EPIPE the reader has closed the pipe
            _print_error("no space left for the output; finished results are kept")
            return 2
        return 1
    if os.environ.get("OMNIDRIVE_TRACEBACK"):
        raise error
    _print_error(
        f"internal error of omnidrive ({type(error).__name__}: {error}). Please report it with the "
        "output of the same command with the environment variable OMNIDRIVE_TRACEBACK=1"
    )
    return 1


def _print_error(message: str) -> None:
    from rich.console import Console

    console = Console(stderr=True)
    with suppress(OSError):  # the terminal is closed
        console.print("[bold red]omnidrive:[/] ", end="")
        console.print(encodable(message, sys.stderr.encoding), markup=False, highlight=False)
