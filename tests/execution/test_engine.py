"""Execution in blocks: sizes, lost processes, messages."""

import logging
import os
import signal
import warnings
from dataclasses import dataclass

import pytest

from omnidrive.compiled import announce_compiling
from omnidrive.compiled.compilation import Compilation, compile_listeners
from omnidrive.execution.engine import ListSource, Work, _BlockSize, execute_blocks
from omnidrive.execution.worker_pool import Lost

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs Unix")


@dataclass(frozen=True)
class Squares:
    """Squares of numbers; some numbers do harm."""

    killing: tuple[int, ...] = ()
    stopping: tuple[int, ...] = ()

    def __call__(self, numbers):
        for number in numbers:
            if number in self.killing:
                os.kill(os.getpid(), signal.SIGKILL)
            if number in self.stopping:
                os.kill(os.getpid(), signal.SIGSTOP)
        return [number * number for number in numbers]


def computed(count, processes=2, *, largest=1000, compute=None, **options):
    """Return the outputs of the blocks of 0, 1, ...; a lost number is its negative."""
    work = Work(
        compute or Squares(),
        lambda number, lost: (-number, lost),
        lambda number: f"number {number}",
        largest,
    )
    return list(execute_blocks(ListSource(range(count), processes), work, processes, **options))


def test_outputs_do_not_depend_on_the_number_of_processes():
    alone = computed(500, 1, in_process=True)
    several = computed(500, 2)
    assert [x for block in alone for x in block] == [n * n for n in range(500)]
    assert sorted(x for block in several for x in block) == [n * n for n in range(500)]


def test_blocks_grow_to_a_second_of_work_and_become_small_at_the_end():
    sizes = [len(block) for block in computed(5000, 1, in_process=True, largest=5000)]
    assert sizes[:5] == [1, 4, 16, 64, 256]
    assert sizes[-1] == 1
    size = _BlockSize(1000)
    for count, seconds in ((1, 30.0), (1, 0.05), (1, 0.05), (1, 0.05), (1, 0.05)):
        size.update(count, seconds)  # the first one compiles kernels
    assert size.count == 1
    for _ in range(12):
        size.update(size.count, 0.05 * size.count)
    assert size.count in range(17, 21)
    size.update(size.count, 0.4 * size.count)
    assert size.count in range(3, 6)


def test_item_that_kills_its_process_is_found_and_the_others_are_computed(caplog):
    found = [x for block in computed(8, compute=Squares(killing=(5,))) for x in block]
    bad = [x for x in found if isinstance(x, tuple)]
    assert bad == [(-5, Lost.KILLED)]
    assert sorted(x for x in found if x not in bad) == [n * n for n in range(8) if n != 5]
    assert "the process of number 5 was killed; starting it again" in caplog.messages


@pytest.mark.long
def test_item_that_takes_too_long_is_ended():
    compute = Squares(stopping=(2,))
    found = [x for b in computed(5, largest=1, compute=compute, time_limit=1.5) for x in b]
    assert sorted(found, key=str) == sorted([0, 1, 9, 16, (-2, Lost.TIMED_OUT)], key=str)


def speak(numbers):
    logging.getLogger("mine").warning("the step %d is infeasible", 3)
    logging.getLogger("mine").info("not shown")
    warnings.warn("division by zero", RuntimeWarning, stacklevel=1)
    for listener in compile_listeners:
        listener(Compilation("kernel"))
    return list(numbers)


def test_messages_of_workers_are_logged_here_once(caplog, capfd):
    with announce_compiling():
        assert len(computed(6, largest=1, compute=speak)) == 6
    messages = [record.message for record in caplog.records]
    assert messages.count("the step 3 is infeasible") == 1
    assert any("division by zero" in message for message in messages)
    assert sum("compiling" in message for message in messages) == 1
    assert "not shown" not in messages
    assert capfd.readouterr() == ("", "")


def test_exception_is_raised_and_ends_the_workers():
    with pytest.raises(TypeError, match="an integer is required"):
        computed(3, compute=failing)


def failing(numbers):
    raise TypeError("an integer is required")
