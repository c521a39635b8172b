"""Time from a start to the first result, with an empty and with a filled cache of kernels.

Prints for the import, `--help`, the first step of a controller and `omnidrive compare` the seconds
of wall time with all kernels compiled ("warm") and with none ("cold"), the seconds that the
compilation of each kernel takes, and the CPU time to read and check the compiled ones.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

from figures import at_most, publish, row

HELP = "import sys, omnidrive_command; sys.argv = ['omnidrive', '--help']; omnidrive_command.main()"
COMPARE = HELP.replace("--help", "compare")
VERBS = ("compare", "plan", "run", "robot", "list", "fuzzy")
VERB_HELP = {verb: HELP.replace("'--help'", f"'{verb}', '--help'") for verb in VERBS}
COMPLETION = HELP.replace("'--help'", "")
LINE = {"_OMNIDRIVE_COMPLETE": "complete_bash", "COMP_CWORD": "3"} | {
    "COMP_WORDS": "omnidrive compare --plant mu"
}
HELP_LIMIT = 0.4  # s
STEP = """
from omnidrive.control import holonomic_nmpc
from omnidrive.robot import named_robot
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
controller = holonomic_nmpc(named_robot("paper").chassis, 0.1)
state = State(0.0, Pose(0.0, 0.0, 0.0))
controller.reset(state)
controller.step(0.0, state, Hold(Pose(1.0, 1.0, 1.0), 1.0))
"""
FIRST_STEPS = """
import json
from omnidrive.scenario.run_parts import make_controller
from omnidrive.scenario.planned_scenario import plan_scenario
from omnidrive.scenario.scenario import paper_scenario
from omnidrive.estimation import State

def first_steps():
    scenario = paper_scenario()
    planned = plan_scenario(scenario)
    reference = planned.reference(20.0)
    for name in scenario.controllers:
        controller = make_controller(scenario, planned.robot, name)
        controller.reset(State(0.0, reference.at(0.0).pose))
        controller.step(0.0, State(0.0, reference.at(0.1).pose), reference)
"""
COMPILING = (
    FIRST_STEPS
    + """
from numba.core.event import install_recorder
with install_recorder("numba:compile") as recorder:
    first_steps()
seconds, begun = {}, []
for time, event in recorder.buffer:
    if event.is_start:
        begun.append(time)
        continue
    first = begun.pop()
    if not begun:
        kernel = event.data["dispatcher"].py_func
        name = f"{kernel.__module__.removeprefix('omnidrive.')}.{kernel.__name__}"
        seconds[name] = seconds.get(name, 0.0) + time - first
print(json.dumps(seconds))
"""
)
READING = (
    FIRST_STEPS
    + """
from time import process_time
from omnidrive.compiled.cache_folder import CacheFolder
read, seconds, sizes = CacheFolder.read, [], []
def timed(folder, name):
    began = process_time()
    content = read(folder, name)
    seconds.append(process_time() - began)
    sizes.append(len(content))
    return content
CacheFolder.read = timed
first_steps()
print(json.dumps([sum(seconds), sum(sizes)]))
"""
)
READ_LIMIT = 20.0  # ms


def seconds(program: str, cache: Path, folder: Path, **variables: str) -> float:
    """Of wall time for a Python program in a process of its own."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)} | variables
    began = perf_counter()
    subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env=environment,
        check=True,
        capture_output=True,
    )
    return perf_counter() - began


def least(program: str, cache: Path, folder: Path, **variables: str) -> float:
    return min(seconds(program, cache, folder, **variables) for _ in range(3))


def printed(program: str, folder: Path) -> Any:
    """Return the JSON that a program prints; its kernels are in a folder of their own."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        step, study = folder / "step", folder / "study"
        rows = [
            row("import, warm", least("import omnidrive", study, folder), "s"),
            at_most("--help", least(HELP, study, folder), "s", HELP_LIMIT),
            *(
                at_most(f"{verb} --help", least(program, study, folder), "s", HELP_LIMIT)
                for verb, program in VERB_HELP.items()
            ),
            at_most(
                "completion of a value", least(COMPLETION, study, folder, **LINE), "s", HELP_LIMIT
            ),
            row("first step of holonomic NMPC, cold", seconds(STEP, step, folder), "s"),
            row("first step of holonomic NMPC, warm", least(STEP, step, folder), "s"),
            row("compare, cold", seconds(COMPARE, study, folder), "s"),
            row("compare, warm", seconds(COMPARE, study, folder), "s"),
        ]
        times = printed(COMPILING, folder)  # of each kernel, with all that it calls
        rows.append(
            at_most("compilation of all that compare needs", sum(times.values()), "s", 35.0)
        )
        reads, sizes = zip(*(printed(READING, folder) for _ in range(3)), strict=True)
        rows.append(
            at_most("read and check compiled kernels, CPU", 1e3 * min(reads), "ms", READ_LIMIT)
        )
        rows.append(row("compiled kernels that compare reads", sizes[0] / 1e6, "MB"))
        for kernel, value in sorted(times.items(), key=lambda each: -each[1]):
            rows.append(row(f"compile {kernel}", value, "s"))
    publish("startup", rows)


if __name__ == "__main__":
    main()
