"""The kernel that is being compiled, on a terminal."""

import logging
import sys

import pytest

from omnidrive.cli import compile_status, terminal
from omnidrive.cli.compile_status import show_compiling
from omnidrive.cli.progress import LiveProgress
from omnidrive.cli.terminal import NoteHandler
from omnidrive.compiled.compilation import Compilation, announce_compiling, notify, reported

LOGGER = logging.getLogger("omnidrive.compiled")
KERNEL = "control.nmpc.solver.solve"


@pytest.fixture
def on_terminal(monkeypatch):
    """Let standard error be a terminal."""
    handlers, level = LOGGER.handlers[:], LOGGER.level
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    show_compiling()
    yield
    LOGGER.handlers[:] = handlers
    LOGGER.setLevel(level)
    terminal._set_quiet(False)


def compile_two():
    with announce_compiling(note=""):
        for kernel in (KERNEL, "fuzzy.batch"):
            notify(Compilation(kernel))
            notify(Compilation(kernel, 1.0))


def test_kernels_are_counted_and_the_line_is_cleared(on_terminal, capsys):
    compile_two()
    shown = [text.strip() for text in capsys.readouterr().err.split("\r")]
    assert [text for text in shown if text] == 2 * ["compiling kernel 1: solve"] + 2 * [
        "compiling kernel 2: batch"
    ]
    assert shown[-1] == ""


def test_kernel_that_another_one_interrupts_is_shown_again(on_terminal, monkeypatch):
    shown = []
    monkeypatch.setattr(compile_status, "displays", [shown.append])
    with announce_compiling(note=""), reported("a.outer"), reported("a.inner"):
        pass
    first, second = "compiling kernel 1: outer", "compiling kernel 2: inner"
    assert shown == [first, second, first, ""]


def test_nothing_is_shown_if_quiet_or_without_terminal(on_terminal, monkeypatch, capsys):
    terminal._set_quiet(True)
    compile_two()
    assert capsys.readouterr().err == ""
    terminal._set_quiet(False)
    LOGGER.handlers.clear()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False)
    show_compiling()
    compile_two()
    assert capsys.readouterr().err == ""


def test_progress_bar_shows_the_kernel_beside_it(on_terminal):
    with LiveProgress() as progress:
        progress.part("simulate", 3)
        task = progress._progress.tasks[-1]
        with announce_compiling(note=""):
            notify(Compilation(KERNEL))
            assert task.fields["what"] == "compiling kernel 1: solve"
            notify(Compilation(KERNEL, 1.0))
        assert task.fields["what"] == ""
    assert len(compile_status.displays) == 1


def test_one_line_without_terminal(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False, raising=False)
    monkeypatch.setattr(terminal._Output, "noted", set())
    handler = NoteHandler(logging.WARNING)
    logging.getLogger().addHandler(handler)
    try:
        show_compiling()
        with announce_compiling():
            notify(Compilation(KERNEL))
            notify(Compilation(KERNEL, 1.0))
    finally:
        logging.getLogger().removeHandler(handler)
    assert capsys.readouterr().err == (
        "omnidrive: note: compiling kernels before their first use; `omnidrive warmup` compiles "
        "those of all commands\n"
    )
