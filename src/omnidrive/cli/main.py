"""The `omnidrive` command: its verbs, and what its exit status means."""

from __future__ import annotations

import logging
import os
import signal
import sys
from contextlib import suppress
from errno import ENOSPC, EPIPE
from importlib import import_module
from types import FrameType
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from omnidrive.errors import OmnidriveError, RunFailed, WorkerLost

VERBS = {
    "compare": "Run the whole study: plan, drive with every controller, measure, report.",
    "plan": "Search a path, smooth it, time it; say what it asks of the robot.",
    "run": "Drive once: one controller, one task, its numbers, time series, figures and report.",
    "warmup": "Compile all numerical kernels now, so that nothing has to wait for them later.",
    "fuzzy": "Show, convert and evaluate fuzzy systems in files: .fis, .fll, .fcl, .fml.",
}
"""Each verb, which has a module of its name here, and the first sentence of its help."""


class _Verbs(TyperGroup):
    """Verbs whose modules are imported when they are asked for: help need not wait for physics."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[Any, Any, list[str]]:
        """The verb named first, with its module imported."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command and load_verb(command.name or ""), rest


def load_verb(name: str) -> Any:
    """Import a verb's module; returns the command that it is."""
    verb = getattr(import_module(f"omnidrive.cli.{name}"), name)
    if not isinstance(verb, typer.Typer):
        alone = typer.Typer(add_completion=False, rich_markup_mode="markdown")
        alone.command()(verb)
        verb = alone
    return typer.main.get_command(verb)


app = typer.Typer(
    name="omnidrive",
    cls=_Verbs,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _name, _help in VERBS.items():
    app.command(_name, help=_help)(lambda: None)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version  # noqa: PLC0415 - takes as long as the rest of this

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
    from rich.console import Console  # noqa: PLC0415 - nobody else needs it at once

    console = Console(stderr=True)
    with suppress(OSError):  # a terminal that was closed
        console.print("[bold red]omnidrive:[/] ", end="")
        console.print(message, markup=False, highlight=False)
