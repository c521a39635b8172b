"""Output of the verbs: results on standard output, notes on standard error."""

from __future__ import annotations

import json
import logging
import re
import sys
from contextlib import contextmanager
from logging.handlers import QueueHandler, QueueListener
from queue import SimpleQueue
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from omnidrive.errors import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_LONGEST = 10_000  # characters of a line about results or input


class _Output:
    """What is printed.

    Attributes:
        quiet: Print errors and the last line only.
        noted: Notes that were printed.
    """

    quiet = False
    noted: ClassVar[set[str]] = set()


def is_quiet() -> bool:
    """Return whether only errors and the last line are printed."""
    return _Output.quiet


def show(text: str = "", head: str = "", **style: Any) -> None:
    """Print a line of results, unless ``--quiet`` is given.

    Args:
        text: The line.
        head: What comes before it, in this ``style``.
        style: Arguments of ``typer.style``.
    """
    if not _Output.quiet:
        _echo(text, head=head, **style)


def conclude(text: str, *, beside_json: bool = False) -> None:
    """Print the last line, which names the folder or file of the results.

    Args:
        text: The line.
        beside_json: Print it on standard error, because standard output holds JSON.
    """
    _echo(one_line(text, _LONGEST), err=beside_json)


def print_json(data: Any) -> None:
    """Print JSON on standard output."""
    _echo(json.dumps(data, indent=2))


def note(text: str) -> None:
    """Print a note on standard error, once, unless ``--quiet`` is given."""
    if text not in _Output.noted:
        _Output.noted.add(text)
        _print(f"note: {text}")


def warn(text: str) -> None:
    """Print a warning about the input on standard error, unless ``--quiet`` is given."""
    _print(f"warning: {text}")


def _print(text: str) -> None:
    """Print a text, which may contain names from files, in one line on standard error."""
    if not _Output.quiet:
        _echo(f"omnidrive: {one_line(' '.join(text.split()), _LONGEST)}", err=True)


def _echo(text: str, *, err: bool = False, head: str = "", **style: Any) -> None:
    """Print a line on standard output or standard error, with a head in a style."""
    stream = sys.stderr if err else sys.stdout
    start = typer.style(encodable(head, stream.encoding), **style) if head else ""
    typer.echo(start + encodable(text, stream.encoding), file=stream)


def encodable(text: str, encoding: str | None) -> str:
    """Return ``text`` with an escape for each character, as of a file name, that has no code."""
    name = encoding or "utf-8"
    return escaped(text).encode(name, "backslashreplace").decode(name)


def escaped(text: str) -> str:
    """Return ``text`` with escapes for control characters, except ends of lines and tabs.

    Names in files may hold sequences that change the terminal.
    """
    return _CONTROL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


class NoteHandler(logging.Handler):
    """Prints log records of all libraries as notes, above the progress display.

    Equal ones are printed once, but for those with the attribute ``is_event``.
    """

    def emit(self, record: logging.LogRecord) -> None:
        """Print the message of a record; warnings of Python are for developers."""
        if record.name == "py.warnings":
            return
        if getattr(record, "is_event", False):
            _print(f"note: {record.getMessage()}")
        else:
            note(record.getMessage())


@contextmanager
def notes_in_a_thread() -> Iterator[None]:
    """Print log records in a thread within the context.

    What logs does then not wait for a terminal whose output is stopped.
    """
    root = logging.getLogger()
    printing = [each for each in root.handlers if isinstance(each, NoteHandler)]
    records: SimpleQueue[logging.LogRecord | None] = SimpleQueue()
    listener = QueueListener(records, *printing, respect_handler_level=True)
    queued = QueueHandler(records)
    queued.setLevel(logging.WARNING)
    for each in printing:
        root.removeHandler(each)
    root.addHandler(queued)
    listener.start()
    try:
        yield
    finally:
        root.removeHandler(queued)
        for each in printing:
            root.addHandler(each)
        listener.stop()


def _set_quiet(value: bool) -> None:
    """Print errors and the last line only, or everything."""
    _Output.quiet = value


def quiet_option() -> Any:
    """Return the option ``--quiet``, which every verb has."""

    def declaration(
        _quiet: Annotated[
            bool,
            typer.Option(
                "--quiet",
                "-q",
                help="Print errors and the last line only, which names the results.",
                callback=_set_quiet,
                expose_value=False,
                show_default=False,
            ),
        ] = False,
    ) -> None:
        """Declare the option; this function is never called."""

    app = typer.Typer(add_completion=False)
    app.command()(declaration)
    return typer.main.get_command(app).params[0]


def count_text(outcomes: dict[str, int]) -> str:
    """Return numbers of runs by outcome, the finished ones first."""
    rest = {name.replace("_", " "): n for name, n in outcomes.items() if name != "finished"}
    parts = [f"{outcomes.get('finished', 0):,} finished"]
    return ", ".join([*parts, *(f"{count:,} {name}" for name, count in rest.items())])
