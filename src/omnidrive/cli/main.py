"""The `omnidrive` command: its verbs, and what its exit status means."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version
from typing import Annotated

import typer
from rich.console import Console

from omnidrive.cli.compare import compare
from omnidrive.cli.plan import plan
from omnidrive.cli.run import run
from omnidrive.errors import OmnidriveError, RunFailed

app = typer.Typer(
    name="omnidrive",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(compare)
app.command()(plan)
app.command()(run)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"omnidrive {version('omnidrive')}")
        raise typer.Exit


@app.callback()
def omnidrive(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Plan, track, simulate and compare trajectory tracking on omnidirectional robots.

    Start with **omnidrive compare**: it runs the reference study on physics and writes a report.

    Units: metres, seconds, radians; headings counter-clockwise from the map's x axis.

    Exit status: 0 done; 1 a fault of omnidrive or a run that failed; 2 a mistake in what was asked;
    130 interrupted.
    """


_INTERRUPTED = 130


def main() -> None:
    """Run the command line and exit with its status."""
    sys.exit(_status())


def _run_verb() -> int:
    status = int(app(prog_name="omnidrive", standalone_mode=False) or 0)
    if status == _INTERRUPTED:  # typer turns Ctrl-C into this status
        _complain("interrupted; what was finished before is kept")
    return status


def _status() -> int:
    """Do what the command line says; every error becomes one paragraph and a status."""
    try:
        return _run_verb()
    except typer.exceptions.TyperException as error:  # a mistake in the options
        error.show() if hasattr(error, "show") else _complain(str(error))
        return int(error.exit_code)
    except OmnidriveError as error:
        _complain(str(error))
        return 1 if isinstance(error, RunFailed) else 2
    except BrokenPipeError:  # the reader of our output has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:
        if os.environ.get("OMNIDRIVE_TRACEBACK"):
            raise
        _complain(
            f"this is a fault of omnidrive, not yours ({type(error).__name__}: {error}). Please "
            "report it with the output of the same command under OMNIDRIVE_TRACEBACK=1"
        )
        return 1


def _complain(message: str) -> None:
    console = Console(stderr=True)
    console.print("[bold red]omnidrive:[/] ", end="")
    console.print(message, markup=False, highlight=False)
