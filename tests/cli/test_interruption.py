"""Interrupted commands keep their results, print one message and leave no process."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

PROC = Path("/proc")
TIMEOUT = 200  # s; the steps take two seconds on an idle desktop computer

# a signal that this process ignores, as under nohup, would be ignored by the command
WITH_DEFAULT_SIGNALS = """
import os, signal, sys
for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
    signal.signal(number, signal.SIG_DFL)
os.execv(sys.executable, [sys.executable, "-m", "omnidrive", *sys.argv[1:]])
"""

COMPARE = [
    "compare", "--out", "cut", "--jobs", "2", "--plant", "mujoco-balls",
    "--controllers", "feedforward", "--tasks", "noise", "--noise-seeds", "200",
]  # fmt: skip
"""A study with a first result soon and many runs."""

pytestmark = pytest.mark.skipif(not (PROC / "self/stat").exists(), reason="needs Linux's /proc")


@pytest.fixture(autouse=True)
def nohup():
    """Ignore SIGHUP in this process, as under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGHUP, before)


def alive(group):
    """Return the command lines of the processes of a group, by process id."""
    found = {}
    for folder in PROC.glob("[0-9]*"):
        try:
            state, _, its_group = (folder / "stat").read_text().rsplit(")", 1)[1].split()[:3]
            if int(its_group) == group and state != "Z":
                found[int(folder.name)] = (folder / "cmdline").read_text()
        except OSError:  # the process has ended
            continue
    return found


def workers(group):
    return [pid for pid, command in alive(group).items() if "spawn_main" in command]


def wait_for(condition, seconds=TIMEOUT):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, f"no success within {seconds} s"
        time.sleep(0.02)


@contextmanager
def compare(folder):
    """Run a study with two workers in a separate process group."""
    with subprocess.Popen(
        [sys.executable, "-S", "-c", WITH_DEFAULT_SIGNALS, *COMPARE],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            if alive(process.pid):
                os.killpg(process.pid, signal.SIGKILL)


def finish(process):
    _, errors = process.communicate(timeout=TIMEOUT)
    assert "Traceback" not in errors
    return " ".join(errors.split())


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        signal.SIGKILL,
        pytest.param(signal.SIGINT, marks=pytest.mark.long),
        pytest.param(signal.SIGHUP, marks=pytest.mark.long),
    ],
)
def test_workers_end_with_the_command_and_results_are_kept(tmp_path, number):
    with compare(tmp_path) as process:
        wait_for((tmp_path / "cut" / "results.json").exists)  # both workers are running
        process.send_signal(number)
        process.wait(TIMEOUT)
        wait_for(lambda: not alive(process.pid), 5)
        errors = finish(process)
    if number == signal.SIGKILL:
        assert process.returncode == -number
    else:
        assert process.returncode == 128 + number
        assert "interrupted" in errors
    assert json.loads((tmp_path / "cut" / "results.json").read_text())["runs"]


def test_closed_terminal_ends_without_traceback(tmp_path):
    with compare(tmp_path) as process:
        wait_for(lambda: workers(process.pid))
        os.killpg(process.pid, signal.SIGHUP)
        assert "interrupted" in finish(process)
        wait_for(lambda: not alive(process.pid), 5)
    assert process.returncode == 128 + signal.SIGHUP


@pytest.mark.parametrize("delay", [0.0, 0.3, 0.8, 1.5])
def test_ctrl_c_during_worker_start_ends_without_traceback(tmp_path, delay):
    with compare(tmp_path) as process:
        wait_for(lambda: workers(process.pid))
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        assert "interrupted" in finish(process)
        wait_for(lambda: not alive(process.pid), 5)
    assert process.returncode == 130


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.02])
def test_ctrl_c_before_worker_start_ends_without_traceback(tmp_path, delay):
    with compare(tmp_path) as process:
        wait_for((tmp_path / "cut").exists)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        assert "interrupted" in finish(process)
        wait_for(lambda: not alive(process.pid), 5)
    assert process.returncode == 130


def test_second_ctrl_c_ends_at_once(tmp_path):
    with compare(tmp_path) as process:
        wait_for((tmp_path / "cut" / "results.json").exists)
        while process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        finish(process)
        wait_for(lambda: not alive(process.pid), 5)
    assert process.returncode in {130, -signal.SIGINT}


def test_killed_worker_is_reported_and_results_are_kept(tmp_path):
    results = tmp_path / "cut" / "results.json"
    with compare(tmp_path) as process:
        wait_for(results.exists)
        os.kill(workers(process.pid)[0], signal.SIGKILL)
        errors = finish(process)
    assert process.returncode == 1
    assert "a worker process was killed" in errors
    assert "--jobs 1" in errors
    assert "internal error of omnidrive" not in errors
    assert json.loads(results.read_text())["runs"]
