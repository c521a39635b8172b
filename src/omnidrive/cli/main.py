"""The `omnidrive` command: its verbs, and what its exit status means."""

from __future__ import annotations

import logging
import os
import signal
import sys
from contextlib import suppress
from errno import ENOSPC, EPIPE
from importlib.metadata import version
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console

from omnidrive.cli.compare import compare
from omnidrive.cli.fuzzy import fuzzy
from omnidrive.cli.plan import plan
from omnidrive.cli.run import run
from omnidrive.cli.warmup import warmup
from omnidrive.errors import OmnidriveError, RunFailed, WorkerLost

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
app.command()(warmup)
app.add_typer(fuzzy, name="fuzzy")


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
    130 interrupted; 128 + n ended by signal n.
    """


_INTERRUPTED = 128 + signal.SIGINT
_ENDINGS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_received: list[int] = []  # the signal that ends this command


def main() -> None:
    """Run the command line and exit with its status."""
    for number in _ENDINGS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup does
            signal.signal(number, _interrupt)
    logging.getLogger("omnidrive").setLevel(logging.ERROR)  # the progress says the rest
    status = _status()
    _stop_listening()
    sys.exit(status)


def _interrupt(number: int, _frame: FrameType | None) -> None:
    """End in order, as on Ctrl-C; a second Ctrl-C ends at once."""
    _stop_listening()
    _received.append(number)
    raise KeyboardInterrupt


def _stop_listening() -> None:
    """Leave SIGINT to the system; ignore the others, which come in pairs (timeout, a terminal)."""
    for number in _ENDINGS:
        if signal.getsignal(number) is _interrupt:
            last = signal.SIG_DFL if number == signal.SIGINT else signal.SIG_IGN
            signal.signal(number, last)


def _status() -> int:
    """Do what the command line says; every error becomes one paragraph and a status."""
    try:
        status = int(app(prog_name="omnidrive", standalone_mode=False) or 0)
    except (Exception, KeyboardInterrupt) as error:
        status = _INTERRUPTED if _received else _explain(error)
    if _received and status == _INTERRUPTED:  # typer turns KeyboardInterrupt into this status
        _complain("interrupted; what was finished before is kept")
        return 128 + _received[0]
    return status


def _explain(error: BaseException) -> int:
    """Say what went wrong; the status that goes with it."""
    if isinstance(error, typer.exceptions.TyperException):  # a mistake in the options
        error.show() if hasattr(error, "show") else _complain(str(error))
        return int(error.exit_code)
    if isinstance(error, OmnidriveError):
        _complain(str(error))
        return 1 if isinstance(error, RunFailed | WorkerLost) else 2
    if isinstance(error, OSError) and error.errno in {EPIPE, ENOSPC}:  # where stdout goes
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == ENOSPC:  # else the reader of our output has gone, and knows it
            _complain("no space is left where the output goes; what was finished before is kept")
            return 2
        return 1
    if os.environ.get("OMNIDRIVE_TRACEBACK"):
        raise error
    _complain(
        f"this is a fault of omnidrive, not yours ({type(error).__name__}: {error}). Please "
        "report it with the output of the same command under OMNIDRIVE_TRACEBACK=1"
    )
    return 1


def _complain(message: str) -> None:
    console = Console(stderr=True)
    with suppress(OSError):  # a terminal that was closed
        console.print("[bold red]omnidrive:[/] ", end="")
        console.print(message, markup=False, highlight=False)
