"""The command line in a separate process."""

import atexit
import gc
import json
import os
import signal
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

_TIMEOUT = 300  # s


def omnidrive(*args, cwd, **env):
    """Run `omnidrive` with arguments; return its status and output.

    Without environment variables but COLUMNS the process is a fork of one that has imported the
    package, and studies draw no figures: both take longer than most commands.
    """
    words = ["omnidrive", *map(str, args)]
    if not env.keys() - {"COLUMNS"}:
        return _forked(words, cwd, env.get("COLUMNS", "200"))
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=cwd, capture_output=True, text=True, timeout=_TIMEOUT,
        check=False, env={**os.environ, "COLUMNS": "200", **env},
    )  # fmt: skip


def _forked(words, cwd, columns):
    with TemporaryDirectory() as folder:
        files = [str(Path(folder, name)) for name in ("stdout", "stderr")]
        server = _server()
        print(json.dumps([words, str(cwd), columns, *files]), file=server.stdin, flush=True)
        status = json.loads(server.stdout.readline())
        output = [Path(file).read_text(encoding="utf-8") for file in files]
    return subprocess.CompletedProcess(words, status, *output)


@cache
def _server():
    """Return the process that runs commands in forks of itself."""
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.command"], cwd=Path(__file__).parents[1],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    atexit.register(server.wait)
    atexit.register(server.stdin.close)
    return server


def _serve():
    """Run one command for each line of the standard input, and answer with its exit status."""
    from omnidrive.evaluation import study_report
    from omnidrive.scenario import paper_scenario, plan_and_check

    for module in (
        "omnidrive.cli.main", "omnidrive.cli.progress", "omnidrive.cli.studies.compare",
        "omnidrive.cli.studies.results", "omnidrive.deploy.log", "omnidrive.study.stored_study",
        "pandas",
    ):  # fmt: skip
        import_module(module)
    plan_and_check(paper_scenario())  # loads the kernels, without a thread
    study_report.write_figures = lambda *_: ()
    gc.freeze()  # otherwise the end of a fork copies and visits all objects: 1.5 s
    for line in sys.stdin:
        process = os.fork()
        if process == 0:
            _run(*json.loads(line))
        _, status = os.waitpid(process, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
    os._exit(0)  # to free all objects takes seconds


def _run(words, cwd, columns, stdout, stderr):
    """Run a command in this process, which ends with it."""
    from omnidrive.cli.main import main

    signal.alarm(_TIMEOUT)
    os.chdir(cwd)
    os.environ["COLUMNS"] = columns
    for number, path in enumerate((os.devnull, stdout, stderr)):
        os.dup2(os.open(path, os.O_RDWR | os.O_CREAT), number)
    sys.argv = words
    main()


if __name__ == "__main__":
    _serve()
