"""Interrupted commands keep their results, print one message and leave no process."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from omnidrive.errors import OmnidriveError
from omnidrive.scenario import load_scenario
from omnidrive.study import read_study
from omnidrive.study.storage.store import Store

PROC = Path("/proc")
TIMEOUT = 200  # s; the steps take two seconds on an idle desktop computer

# a signal that this process ignores, as under nohup, would be ignored by the command
WITH_DEFAULT_SIGNALS = """
import os, signal, sys
for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
    signal.signal(number, signal.SIG_DFL)
code = "from omnidrive_command import main; print('started', flush=True); main()"
os.execv(sys.executable, [sys.executable, "-c", code, *sys.argv[1:]])
"""

MANY_RUNS = [
    "compare", "--out", "cut", "--jobs", "2", "--plant", "mujoco-balls", "--figures", "none",
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
    return [pid for pid, command in alive(group).items() if "popen_loky" in command]


def wait_for(condition, seconds=TIMEOUT):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, f"no success within {seconds} s"
        time.sleep(0.02)


def has_results(folder):
    """Return whether a run of the study in a folder is stored."""
    if (folder / "runs.sqlite").exists():
        with suppress(OmnidriveError), Store(folder, read_only=True) as store:  # being created
            return store.count > 0
    return False


@contextmanager
def command(folder, args=MANY_RUNS, **env):
    """Run a command in a separate process group; wait until Python has started."""
    with subprocess.Popen(
        [sys.executable, "-S", "-c", WITH_DEFAULT_SIGNALS, *args],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | env,
    ) as process:
        try:
            assert process.stdout.readline() == "started\n"
            yield process
        finally:
            if alive(process.pid):
                os.killpg(process.pid, signal.SIGKILL)


def finish(process):
    _, errors = process.communicate(timeout=TIMEOUT)
    if process.returncode == -signal.SIGKILL:  # a worker that was being started says so
        errors, _, _ = errors.partition("LokyProcess")
    assert "Traceback" not in errors, errors
    return " ".join(errors.split())


def interrupt(process, number):
    """Send a signal to all processes of a command, as a terminal does; check how they end."""
    os.killpg(process.pid, number)
    assert "interrupted" in finish(process)
    wait_for(lambda: not alive(process.pid), 30)
    assert process.returncode == 128 + number


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGTERM, marks=pytest.mark.long),
        pytest.param(signal.SIGKILL, marks=pytest.mark.long),
        pytest.param(signal.SIGINT, marks=pytest.mark.long),
        pytest.param(signal.SIGHUP, marks=pytest.mark.long),
    ],
)
def test_workers_end_with_the_command_and_results_are_kept(tmp_path, number):
    with command(tmp_path) as process:
        wait_for(lambda: has_results(tmp_path / "cut"))  # both workers are running
        process.send_signal(number)
        process.wait(TIMEOUT)
        wait_for(lambda: not alive(process.pid), 30)
        errors = finish(process)
    if number == signal.SIGKILL:
        assert process.returncode == -number
    else:
        assert process.returncode == 128 + number
        assert "interrupted" in errors
        assert json.loads((tmp_path / "cut" / "results.json").read_text())["runs"]
    assert check_readable(tmp_path / "cut")


@pytest.mark.long
def test_closed_terminal_ends_without_traceback(tmp_path):
    with command(tmp_path) as process:
        wait_for(lambda: workers(process.pid))
        interrupt(process, signal.SIGHUP)


@pytest.mark.long
@pytest.mark.parametrize("delay", [0.0, 0.8])
def test_ctrl_c_during_worker_start_ends_without_traceback(tmp_path, delay):
    with command(tmp_path) as process:
        wait_for(lambda: workers(process.pid))
        time.sleep(delay)
        interrupt(process, signal.SIGINT)


def test_ctrl_c_before_worker_start_ends_without_traceback(tmp_path):
    with command(tmp_path) as process:
        wait_for((tmp_path / "cut").exists)
        interrupt(process, signal.SIGINT)


@pytest.mark.long
def test_second_ctrl_c_ends_at_once(tmp_path):
    with command(tmp_path) as process:
        wait_for(lambda: has_results(tmp_path / "cut"))
        while process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        finish(process)
        wait_for(lambda: not alive(process.pid), 30)
    assert process.returncode in {130, -signal.SIGINT}


@pytest.mark.long
def test_killed_worker_delays_the_study_only(tmp_path):
    few = [*MANY_RUNS[:-1], "20"]
    with command(tmp_path, few) as process:
        wait_for(lambda: has_results(tmp_path / "cut"))
        os.kill(workers(process.pid)[0], signal.SIGKILL)
        errors = finish(process)
    assert process.returncode == 0, errors
    assert "was killed; starting it again" in errors
    runs = json.loads((tmp_path / "cut" / "results.json").read_text())["runs"]
    assert len(runs) == 20
    assert all(run["finished"] for run in runs)


SMALL = ["--plant", "kinematic", "--out", "out"]
COMMANDS = (
    ["compare", *SMALL, "--controllers", "feedforward,pid", "--tasks", "noise,step", "--jobs", "2",
     "--noise-seeds", "12"],
    ["compare", *SMALL, "--controllers", "feedforward", "--tasks", "track,step", "--jobs", "1"],
    ["run", *SMALL, "--controller", "pid", "--task", "step"],
    ["plan", "--search", "astar", "--out", "out", "--png", "plan.png"],
)  # fmt: skip
PHASES = ("start", "compile", "plan", "simulate", "figures", "report")


def reached(phase, folder):
    """Return whether a command has reached a phase, by the files that it has written."""
    files = {"simulate": "scenario.yaml", "figures": "figures", "report": "tables"}
    return phase not in files or (folder / "out" / files[phase]).exists()


def check_readable(out):
    """Check that every file without the suffix .part is complete; return the number of runs."""
    if (out / "scenario.yaml").exists():
        load_scenario(out / "scenario.yaml")
    for path in out.glob("series/*.parquet"):
        assert pq.read_table(path).num_rows > 10
    for pattern, end in (("*.svg", b"</svg>"), ("*.html", b"</html>")):
        for path in out.rglob(pattern):
            assert path.read_bytes().rstrip().endswith(end), path
    if (out / "results.json").exists():
        data = json.loads((out / "results.json").read_text())
        for record in (*data["runs"], *data["step_response"]):
            assert (out / record["series"]).exists()
    if not has_results(out):
        return 0
    records = read_study(out).records
    for record in records:
        assert (out / "series" / f"{record.name}.parquet").exists()
    return len(records)


def signal_once(folder, seed, cold_cache):
    """Send a signal at a random moment of a random phase; return what happened."""
    rng = random.Random(seed)
    phase = rng.choice(PHASES)
    number = rng.choice((signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL))
    args = rng.choice(COMMANDS[:3] if phase in {"figures", "report"} else COMMANDS)
    env = {"NUMBA_CACHE_DIR": str(cold_cache)} if phase == "compile" else {}
    longest = {"start": 1.0, "compile": 8.0, "plan": 3.0, "report": 0.3}.get(phase, 2.0)
    delay = rng.uniform(0.0, longest)
    group = rng.random() < 0.3  # as a terminal or systemd do
    what = (
        f"seed {seed}: {signal.Signals(number).name} {delay:.3f} s into {phase} of {' '.join(args)}"
    )
    with command(folder, args, **env) as process:
        while process.poll() is None and not reached(phase, folder):
            time.sleep(0.005)
        with suppress(subprocess.TimeoutExpired):
            process.wait(delay)
        late = process.poll() is not None
        if not late:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, number) if group else process.send_signal(number)
        sent = time.monotonic()
        _, errors = process.communicate(timeout=TIMEOUT)
        status, took = process.returncode, time.monotonic() - sent
        wait_for(lambda: not alive(process.pid), 30)
    what += f": status {status} after {took:.2f} s"
    expected = {0} if late else {128 + number, -number}
    ended_itself = status == 0 and took < 0.1  # the process ended before it received the signal
    assert status in expected or ended_itself, f"{what}\n{errors}"
    if number != signal.SIGKILL:  # then helpers of libraries may complain
        assert "Traceback" not in errors, f"{what}\n{errors}"
    runs = check_readable(folder / "out")
    return f"{what}; {runs} runs{' (too late)' if late or ended_itself else ''}"


@pytest.mark.long
def test_signals_at_random_moments_of_every_phase(tmp_path):
    """Right exit status, no process left, every finished run readable."""
    for seed in range(2_026_000, 2_026_300):
        folder, cold_cache = tmp_path / str(seed), tmp_path / "cache" / str(seed)
        folder.mkdir()
        print(signal_once(folder, seed, cold_cache))  # shown by -s
