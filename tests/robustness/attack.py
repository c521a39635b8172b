"""Attack of all readers with mutated files: exceptions, time and memory of every input.

``python -m tests.robustness.attack SEED FIRST LAST`` reads the inputs FIRST to LAST of a seed in
this process, and prints a line before and after each; ``python -m tests.robustness.attack SEED
INDEX`` reads one and shows its traceback. :func:`attack` runs such processes, each with a limit of
its memory, kills those that hang, and goes on after the input that did it.
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread
from typing import NamedTuple

from omnidrive.errors import OmnidriveError
from tests.robustness.mutations import mutate
from tests.robustness.readers import readers

ROOT = Path(__file__).resolve().parents[2]
MAX_SECONDS, MAX_BYTES = 5.0, 500_000_000
"""Limits of processor time and of memory beyond that of the process, per input."""
_KILL_AFTER = 60.0  # s of processor time or sleep without a result
_KILL_COMPILING_AFTER = 600.0
"""Likewise while valid files are read, in s: the process compiles kernels, or waits for another one
that does."""
_INTERVAL = 5.0  # s between looks at a process
_BATCH = 10_000  # inputs per process


class Outcome(NamedTuple):
    """Result of one input.

    Attributes:
        index: Index of the input.
        reader: Name of the reader.
        accepted: Whether the reader raised no error.
        seconds: Processor time.
        growth: Peak of the resident memory above that before, in bytes; 0 if it is not known.
        fault: Broken limit; empty: none.
    """

    index: int
    reader: str
    accepted: bool
    seconds: float
    growth: int
    fault: str


def mutated_input(seed, index):
    """Return the name of the reader and the content of an input."""
    rng = random.Random(f"{seed} {index}")
    name = list(readers())[index % len(readers())]
    others = [*readers()[name].valid, *rng.choice(list(readers().values())).valid]
    return name, mutate(rng.choice(readers()[name].valid), others, rng)


def read_input(index, name, content, folder):
    """Read a mutated file in an empty folder and return the outcome."""
    reader = readers()[name]
    path = reader.write(folder, content)
    before, began = _resident_peak(reset=True), time.process_time()
    accepted, fault = True, ""
    try:
        reader.read(path)
    except OmnidriveError as error:
        accepted, fault = False, _fault_of_message(str(error))
    except Exception as error:
        fault = f"{type(error).__name__}: {error}"[:300]
    seconds, growth = time.process_time() - began, max(_resident_peak() - before, 0)
    for each in folder.iterdir():
        each.unlink()
    if not fault and seconds > MAX_SECONDS:
        fault = f"takes {seconds:.1f} s"
    if not fault and growth > MAX_BYTES:
        fault = f"takes {growth / 1e6:.0f} MB"
    return Outcome(index, name, accepted, seconds, growth, fault)


def _fault_of_message(text):
    if not text.isprintable():
        return f"message of several lines: {text[:200]!r}"
    return f"message of {len(text)} characters: {text[:200]!r}" if len(text) > 2500 else ""


def _resident_peak(*, reset=False):
    """Return the peak of the resident memory since the last reset, in bytes."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def read_valid():
    """Yield the outcomes of the valid files, with index -1; kernels are compiled on the way."""
    with TemporaryDirectory() as folder:
        for name, reader in readers().items():
            for content in reader.valid:
                outcome = read_input(-1, name, content, Path(folder))
                assert outcome.accepted, (name, content)
                assert not outcome.fault or outcome.fault.startswith("takes"), outcome
                yield outcome


def read_mutated(seed, indices):
    """Yield the outcome of every input; a warning is a fault."""
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        for index in indices:
            yield read_input(index, *mutated_input(seed, index), Path(folder))


def attack(seed, indices, report=lambda outcome: None):
    """Read the inputs of a seed in one process after another.

    Args:
        seed: Seed of the inputs.
        indices: Range of their indices.
        report: Called with every outcome.
    """
    first, end = indices.start, indices.stop
    while first < end:
        last = min(first + _BATCH, end) - 1
        with subprocess.Popen(
            [sys.executable, "-m", "tests.robustness.attack", str(seed), str(first), str(last)],
            cwd=ROOT, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT)])},
        ) as process:  # fmt: skip
            limit = _KILL_COMPILING_AFTER
            while value := _line(process, limit):
                outcome = Outcome(*value)
                if outcome.index >= 0:
                    limit = _KILL_AFTER
                    report(outcome)
                    first = outcome.index + 1
        if first <= last:
            name = mutated_input(seed, first)[0]
            killed = process.returncode == -signal.SIGKILL
            fault = "hangs" if killed else f"ends the process with {process.returncode}"
            report(Outcome(first, name, False, 0.0, 0, fault))
            first += 1


def _line(process, limit):
    """Return the next value that a process prints, None at its end; kill it if it hangs."""
    done = Event()
    guard = Thread(target=_kill_if_it_hangs, args=(process, done, limit))
    guard.start()
    line = process.stdout.readline()
    done.set()
    guard.join()
    return json.loads(line) if line.endswith("\n") else None


def _kill_if_it_hangs(process, done, limit):
    """Kill a process that computes or sleeps for more than ``limit`` (s) before ``done`` is set."""
    before, asleep = _status(process.pid)[1], 0.0
    while not done.wait(_INTERVAL):
        state, seconds = _status(process.pid)
        asleep = 0.0 if state == "R" else asleep + _INTERVAL  # it may wait for a processor
        if max(seconds - before, asleep) > limit:
            process.kill()


def _status(process):
    """Return the state of a process, R if it can run, and its processor time in s."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    except OSError:  # it has ended
        return "R", 0.0
    fields = text.rpartition(")")[2].split()
    return fields[0], (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _main(seed, first, last=None):
    if last is None:
        name, content = mutated_input(seed, first)
        print(name, repr(content[:2000]))
        with TemporaryDirectory() as folder:
            reader = readers()[name]
            reader.read(reader.write(Path(folder), content))
        return
    for outcome in read_valid():
        print(json.dumps(outcome), flush=True)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit = pages * resource.getpagesize() + 2 * MAX_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for outcome in read_mutated(seed, range(first, last + 1)):
        print(json.dumps(outcome), flush=True)


if __name__ == "__main__":
    _main(*map(int, sys.argv[1:]))
