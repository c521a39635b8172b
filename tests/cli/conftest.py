"""Fixtures of tests that run the command in this process."""

import logging
import signal

import pytest

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
