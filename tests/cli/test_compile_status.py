"""The kernel that is being compiled, on a terminal."""

import logging
import os
import subprocess
import sys

import pytest

from omnidrive.cli import compile_status, terminal
from omnidrive.cli.compile_status import show_compiling
from omnidrive.cli.progress import LiveProgress
from omnidrive.compiled.compilation import Compilation, announce_compiling, notify

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
    assert [text for text in shown if text] == 2 * ["compiling kernel 1: solver.solve"] + 2 * [
        "compiling kernel 2: fuzzy.batch"
    ]
    assert shown[-1] == ""


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
            assert task.fields["what"] == "compiling kernel 1: solver.solve"
            notify(Compilation(KERNEL, 1.0))
        assert task.fields["what"] == ""
    assert len(compile_status.displays) == 1


COLD = """
from pathlib import Path
from omnidrive.cli.compile_status import show_compiling
from omnidrive.cli.terminal import NoteHandler
from omnidrive.compiled import announce_compiling, compiled
import logging

@compiled
def double(x):
    return 2.0 * x

logging.getLogger().addHandler(NoteHandler(logging.WARNING))
show_compiling()
with announce_compiling():
    print(double(1.0))
"""


def test_one_line_without_terminal(tmp_path):
    (tmp_path / "program.py").write_text(COLD)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "program.py")], capture_output=True, text=True, check=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    assert done.stdout == "2.0\n"
    assert done.stderr == (
        "omnidrive: note: compiling kernels before their first use; `omnidrive warmup` compiles "
        "those of all commands\n"
    )
