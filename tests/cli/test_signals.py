"""Signals end the command with 128 + n, also where Python ignores or other code catches them."""

import os
import signal
import weakref
from importlib import import_module
from time import sleep

import pytest

import omnidrive_command as signals
from omnidrive.errors import CannotWrite

main_module = import_module("omnidrive.cli.main")


@pytest.fixture(autouse=True)
def default_handlers(restored_handlers):
    """Let every signal raise KeyboardInterrupt before the command handles it."""
    for number in signals._SIGNALS:
        signal.signal(number, signal.default_int_handler)


@pytest.fixture
def installed():
    signals.install()
    yield
    signals.restore()


def ignore(number):
    """Receive a signal in the callback of a weak reference, where Python ignores exceptions."""
    target = type("Target", (), {})()
    reference = weakref.ref(target, lambda _: signal.raise_signal(number))
    del target
    return reference


@pytest.mark.parametrize("number", signals._SIGNALS)
def test_ignored_interruption_is_raised_again(installed, number):
    ignore(number)
    with pytest.raises(KeyboardInterrupt):
        sleep(5.0)
    assert signals.restore() == number


def test_caught_interruption_is_raised_at_the_next_step(installed):
    signals.check_interrupted()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):
        signals.check_interrupted()


def test_second_signal_ends_at_once_unless_it_is_the_same_one(installed, monkeypatch):
    ended = []
    monkeypatch.setattr(os, "_exit", ended.append)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    signal.raise_signal(signal.SIGTERM)
    assert not ended
    signals._State.since -= 2.0
    signal.raise_signal(signal.SIGINT)
    assert ended == [128 + signal.SIGTERM]


def caught():
    try:
        signal.raise_signal(signal.SIGTERM)
    except BaseException:
        return


def failing():
    """Let an error of the package follow an interruption."""
    caught()
    raise CannotWrite("a consequence")


@pytest.mark.parametrize("work", [caught, failing, lambda: ignore(signal.SIGTERM)])
def test_status_is_that_of_the_signal_whatever_the_command_does(monkeypatch, capsys, work):
    monkeypatch.setattr(main_module, "app", lambda **_: work())
    with pytest.raises(SystemExit) as ended:
        signals.main()
    assert ended.value.code == 128 + signal.SIGTERM
    signals.check_interrupted()  # that command has ended
    assert capsys.readouterr().err == "omnidrive: interrupted; finished results are kept\n"


def test_ignored_signals_stay_ignored(monkeypatch):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # as SIGHUP under nohup
    monkeypatch.setattr(main_module, "app", lambda **_: signal.raise_signal(signal.SIGTERM))
    with pytest.raises(SystemExit) as ended:
        signals.main()
    assert ended.value.code == 0


def test_interruption_is_not_lost_while_the_command_is_imported(monkeypatch):
    def import_slowly(name):
        ignore(signal.SIGTERM)
        sleep(5.0)
        pytest.fail("the import is not interrupted")

    monkeypatch.setattr(signals, "import_module", import_slowly)
    with pytest.raises(SystemExit) as ended:
        signals.main()
    assert ended.value.code == 128 + signal.SIGTERM
