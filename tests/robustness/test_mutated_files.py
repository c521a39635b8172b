"""Every reader answers a mutated file by a result or a short error, soon and in little memory."""

import ast
import gc
import os
import random
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from signal import SIGKILL

import pytest

from omnidrive.errors import OmnidriveError
from tests.robustness.attack import (
    ROOT,
    _line,
    attack,
    mutated_input,
    read_input,
    read_mutated,
    read_valid,
)
from tests.robustness.readers import readers

COUNT = int(os.environ.get("OMNIDRIVE_MUTATIONS", "10000"))
"""Number of mutated files per reader of the long test."""


def test_mutated_files_are_read_or_refused():
    seed, reached = 20261123, set()
    assert len(list(read_valid())) > len(readers())
    for outcome in read_mutated(seed, range(2 * len(readers()))):
        assert not outcome.fault, f"seed {seed}, {outcome}"
        reached.add(outcome.accepted)
    assert reached == {False, True}


READER = re.compile(r"(load|read|parse|decode|import)_[a-z0-9_]+")
NO_READERS = {
    "omnidrive.cli.fuzzy_systems.fuzzy_actions.parse_choices": "options of the command line",
    "omnidrive.cli.main.load_verb": "a module",
    "omnidrive.cli.options.parse_coordinates": "options of the command line",
    "omnidrive.cli.options.parse_waypoint": "options of the command line",
    "omnidrive.components.code.import_code": "code, which is not read without permission",
    "omnidrive.components.specification.parse_specification": "options of the command line",
    "omnidrive.evaluation.page.document.read_parts": "files of the package",
    "omnidrive.simulation.disturbances.fault_text.parse_fault": "options of the command line",
}
"""Functions with the name of a reader that read no file and no message."""


def reader_functions():
    """Return the functions of the package whose name is that of a reader, with their modules."""
    found = set()
    for path in (ROOT / "src" / "omnidrive").rglob("*.py"):
        module = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and READER.fullmatch(node.name):
                found.add(f"{module}.{node.name}")
    return found


def test_no_reader_is_missing():
    """Valid files and messages reach every function that reads one."""
    called = set()

    def note(frame, event, _):
        if event == "call":
            called.add(f"{frame.f_globals.get('__name__')}.{frame.f_code.co_name}")

    found = reader_functions()
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        assert len(list(read_valid())) > len(readers())
    finally:
        sys.setprofile(before)
    assert found - called == NO_READERS.keys()


def test_pipes_are_refused_at_once(tmp_path):
    """To wait for the other end of a pipe could take for ever."""
    for k, reader in enumerate(readers().values()):
        folder = tmp_path / str(k)
        folder.mkdir()
        pipe = reader.write(folder, b"")
        pipe.unlink()
        os.mkfifo(pipe)
        with pytest.raises(
            OmnidriveError,
            match=r"is not a file but a pipe; save its|no file runs",
        ):
            reader.read(pipe)


@pytest.mark.long
def test_many_mutated_files_are_read_or_refused():
    """In processes with limited memory, which are killed if they hang."""
    seed, outcomes = random.randrange(2**32), []
    count = COUNT * len(readers())
    with ThreadPoolExecutor(2) as pool:
        parts = (range(count // 2), range(count // 2, count))
        list(pool.map(lambda part: attack(seed, part, outcomes.append), parts))
    assert len(outcomes) == count
    faults = [outcome for outcome in outcomes if outcome.fault]
    slowest, largest = (max(getattr(o, key) for o in outcomes) for key in ("seconds", "growth"))
    print(f"seed {seed}: at most {slowest:.2f} s and {largest / 1e6:.0f} MB per file")
    assert not faults, f"seed {seed}: {faults[:10]}"


def test_input_depends_on_seed_and_index_only():
    found = [mutated_input(seed, index) for seed in (1, 2) for index in (0, 1)]
    assert found == [mutated_input(seed, index) for seed in (1, 2) for index in (0, 1)]
    assert len(set(found)) == 4


@pytest.mark.parametrize(
    ("read", "fault"),
    [
        (lambda path: 1 / 0, r"ZeroDivisionError: division by zero"),
        (lambda path: len(b"x" * 200_000_000), r"takes \d+ MB"),
        (lambda path: path.read_text(), r""),
    ],
)
def test_faults_are_found(monkeypatch, tmp_path, read, fault):
    monkeypatch.setattr("tests.robustness.attack.MAX_BYTES", 20_000_000)
    name = next(iter(readers()))
    monkeypatch.setitem(readers(), name, readers()[name]._replace(read=read))
    gc.collect()  # otherwise what is freed during the call hides what it takes
    assert re.fullmatch(fault, read_input(0, name, b"", tmp_path).fault)
    assert not list(Path(tmp_path).iterdir())


def test_process_that_hangs_is_killed(monkeypatch):
    """The rest of its inputs is read by another one."""
    monkeypatch.setattr("tests.robustness.attack._KILL_COMPILING_AFTER", 0.0)
    monkeypatch.setattr("tests.robustness.attack._INTERVAL", 0.05)
    outcomes = []
    attack(1, range(2), outcomes.append)
    assert [(outcome.index, outcome.fault) for outcome in outcomes] == [(0, "hangs"), (1, "hangs")]


def test_process_may_wait_for_kernels_before_the_first_input(monkeypatch):
    """Another process may compile them, which takes minutes on a busy computer."""
    values = [(-1, "nav2", True, 0.1, 0, ""), (0, "nav2", False, 0.1, 0, ""), None]
    limits = []

    def line(process, limit):
        limits.append(limit)
        return values[len(limits) - 1]

    monkeypatch.setattr("tests.robustness.attack._line", line)
    monkeypatch.setattr("tests.robustness.attack.subprocess.Popen", lambda *_, **__: nullcontext())
    attack(1, range(1))
    assert limits == [600.0, 600.0, 60.0]


def test_sleeping_process_is_killed_after_its_limit(monkeypatch):
    monkeypatch.setattr("tests.robustness.attack._INTERVAL", 0.02)
    for limit, code in ((0.03, -SIGKILL), (60.0, 0)):
        with subprocess.Popen(["sleep", "0.2"], stdout=subprocess.PIPE, text=True) as process:
            assert _line(process, limit) is None
        assert process.returncode == code
