"""Fixtures of tests that run the command in this process."""

import logging
import signal

import pytest

from omnidrive.cli import terminal
from omnidrive.cli.main import main
from omnidrive_command import _SIGNALS


@pytest.fixture
def restored_handlers():
    """Restore the handlers of signals and messages after the test; the command sets its own."""
    messages = logging.getLogger().handlers[:]
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    yield
    logging.getLogger().handlers[:] = messages
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def command(monkeypatch, capsys, tmp_path, restored_handlers):
    """Run the command in this process; return its status, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(terminal._Output, "noted", set())

    def run(*args):
        monkeypatch.setattr("sys.argv", ["omnidrive", *map(str, args)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    yield run
    terminal._set_quiet(False)
