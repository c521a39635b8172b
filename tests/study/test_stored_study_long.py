"""Report of a large study."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

from omnidrive.evaluation.run_record import RunRecord
from omnidrive.study import RunPlan, parse_definition, save_definition
from omnidrive.study.output_paths import DEFINITION_FILE
from omnidrive.study.storage.store import Store
from omnidrive.study.study_folder import note_file
from tests.study.test_stored_study import DEFINITION

METRICS = (
    "me", "mae", "max_error", "me_measured", "mae_measured", "me_after_start", "mae_after_start",
    "work", "wheel_acceleration", "path_me", "path_mae", "arrival", "fallbacks", "min_clearance",
    "collisions",
)  # fmt: skip
CONTROLLERS = ("pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3", "feedforward")


def large_study(folder, runs, seed=1):
    """Write a study of so many runs, some of which fail."""
    folder.mkdir()
    tasks = {"noise": {"durations": [8.0]}, "track": {"durations": [8.0]}}
    scenario = {**DEFINITION["scenario"], "controllers": list(CONTROLLERS), "tasks": tasks}
    axes = {"sample_time": [0.05, 0.1, 0.15, 0.2, 0.25],
            "reference.radius": [1.0, 1.5, 2.0, 2.5]}  # fmt: skip
    changes = {"scenario": scenario, "axes": axes, "random": {}, "repetitions": runs // 200}
    definition = parse_definition({**DEFINITION, **changes}, "test")
    save_definition(definition, folder / "study.yaml")
    assert len(RunPlan(definition)) == runs
    rng = np.random.default_rng(seed)
    with Store(folder) as store:
        store.begin("hash")
        for start in range(0, runs, 5000):
            store.add([_record(n, rng) for n in range(start, min(start + 5000, runs))])
        note_file(store, folder / DEFINITION_FILE, RunPlan(definition))


def _record(number, rng):
    repetition, rest = divmod(number, 200)
    values, job = divmod(rest, 10)
    (i, j), (task, c) = divmod(values, 4), divmod(job, 5)
    finished = bool(rng.random() > 0.02 * c)
    metrics = (0.05 + 0.01 * c + 0.02 * i + 0.005 * j) * rng.gamma(20.0, 0.05, len(METRICS))
    return RunRecord(
        number, f"{number:064x}", 2 * (20 * repetition + values) + task, CONTROLLERS[c],
        ("track", "noise")[task], repetition,
        {"sample_time": 0.05 * (i + 1), "reference.radius": 1.0 + 0.5 * j},
        "finished" if finished else "stopped_by_watchdog", finished,
        dict(zip(METRICS, metrics.tolist(), strict=True)),
        {"step_time_median": 10.0 * (c + 1) * rng.gamma(50.0, 0.02), "step_time_p99": 90.0},
        duration=8.0,
    )  # fmt: skip


@pytest.mark.long
def test_report_of_100_000_runs_takes_less_than_10_seconds_and_500_megabytes(tmp_path):
    """Processor time, because the tests share the processor.

    The memory is that since the start of the program: the usage that wait4 returns includes that of
    this process before.
    """
    folder = tmp_path / "study"
    large_study(folder, 100_000)
    code = (
        "import atexit, sys\n"
        "from pathlib import Path\n"
        "from omnidrive.cli.main import main\n"
        "memory = Path(sys.argv.pop())\n"
        "atexit.register(lambda: memory.write_text(Path('/proc/self/status').read_text()))\n"
        "main()"
    )
    memory = tmp_path / "memory"
    verb = ["study", "report", str(folder), "--quiet", str(memory)]
    command = [sys.executable, "-c", code, *verb]
    process = subprocess.Popen(command, env=os.environ | {"OMP_NUM_THREADS": "1"})
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = status
    assert status == 0
    assert used.ru_utime + used.ru_stime < 10.0
    (largest,) = re.findall(r"VmHWM:\s+(\d+) kB", memory.read_text(encoding="ascii"))
    print(f"{used.ru_utime + used.ru_stime:.1f} s, {int(largest) / 1000:.0f} MB")
    assert int(largest) < 500_000
    assert (folder / "report.html").stat().st_size < 5e6
