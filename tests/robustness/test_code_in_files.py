"""No file brings code: what files name is imported with permission only, and nothing beside them.

The files of a stranger name code that leaves a mark when it is imported.
"""

import os
import pickle
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
import yaml
from typer.exceptions import TyperException

from omnidrive.cli.main import VERBS, load_verb
from omnidrive.cli.terminal import encodable
from omnidrive.components import configure
from omnidrive.components.code import CodePermission
from omnidrive.deploy.ros2.drive_files import drive_of_log, parameters_file, reference_file
from omnidrive.deploy.ros2.drive_settings import DriveSettings
from omnidrive.deploy.scenario_files import PREFIX, scenario_of_log
from omnidrive.errors import InvalidInput, OmnidriveError
from omnidrive.geometry import Pose
from omnidrive.maps import load_map
from omnidrive.reference.components import ReferenceContext
from omnidrive.robot import named_robot
from omnidrive.scenario import load_scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.scenario_path import code_in
from omnidrive.study import load_definition, read_study
from omnidrive.study.study_folder import load_study
from omnidrive.tuning import load_tuning
from tests.command import omnidrive
from tests.study.small import small_scenario

CODE = """
import pathlib
import omnidrive as od
pathlib.Path(__file__).with_name("mark").touch()

class Law:
    def reset(self, state): pass
    def step(self, t, state, reference):
        return od.Command(od.BodyTwist(0.0, 0.0, 0.0))
"""
TASKS = {"step": {"displacement": [0.3, 0.1, 0.2], "duration": 0.5}}
PATHS = ("scenario.yaml", "study.yaml", "law.yaml", "params.yaml", "stored", "tuned", "map.npy")


class Stranger:
    """A folder of files, all of which name the same code."""

    def __init__(self, folder):
        self.folder, self.law = folder, f"{folder / 'law.py'}:Law"
        (folder / "law.py").write_text(f"# {folder}\n{CODE}", encoding="utf-8")  # not imported yet
        data = scenario_data(small_scenario(controllers=["feedforward"]))
        scenario = data | {"controllers": {"own": self.law}, "tasks": TASKS}
        study = {"format": "omnidrive-study-1", "name": "s", "scenario": scenario}
        axis = {**study, "scenario": "paper", "set": {"plant": "kinematic"}}
        axis["axes"] = {"plant": ["planar", self.law]}
        parameters = {"/**": {"ros__parameters": {"controller": self.law}}}
        settings = {"format": "omnidrive-tuning-1", "controller": "own"}
        self._write("scenario.yaml", scenario)
        self._write("study.yaml", study)
        self._write("axis.yaml", axis)
        self._write("law.yaml", {"format": "omnidrive-controller-1", "type": self.law})
        self._write("params.yaml", parameters)
        self._write("stored/study.yaml", study)
        self._write("tuned/tuning.yaml", settings)
        self._write("tuned/training.yaml", study)
        self._write("tuned/held-out.yaml", study | {"repetitions": 2})
        np.save(folder / "map.npy", np.array([_Mark(folder / "mark")]), allow_pickle=True)

    def _write(self, name, data):
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(yaml.safe_dump(data), encoding="utf-8")

    def took_effect(self):
        """Return whether code ran since the last call."""
        mark = self.folder / "mark"
        found = mark.exists()
        mark.unlink(missing_ok=True)
        return found


class _Mark:
    """Leaves a mark when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.fixture
def stranger(tmp_path):
    folder = tmp_path / "stranger"
    folder.mkdir()
    return Stranger(folder)


def _arguments(command):
    return [each for each in command.params if each.param_type_name == "argument"]


COMMANDS = [
    (verb, name)
    for verb in VERBS
    for name, each in getattr(load_verb(verb), "commands", {"": load_verb(verb)}).items()
    if _arguments(each)
]


def test_no_verb_runs_code_of_the_file_that_is_its_argument(stranger, monkeypatch, capsys):
    """Every verb of the parser that has an argument, with every file."""
    monkeypatch.chdir(stranger.folder)
    for verb, name in COMMANDS:
        command = load_verb(verb)
        count = len(_arguments(getattr(command, "commands", {"": command})[name]))
        for file in PATHS:
            path = str(stranger.folder / file)
            words = [*([name] if name else []), *[path] * count]
            with suppress(OmnidriveError, OSError, SystemExit, TyperException):
                command(words, prog_name="omnidrive", standalone_mode=False)
            assert not stranger.took_effect(), (verb, name, file)
    capsys.readouterr()


OPTIONS = {
    "compare": ("compare", "scenario.yaml", "--tasks", "step", "--jobs", "1", "--out", "new"),
    "run": ("run", "--controller", "law.yaml", "--task", "step", "--plant", "kinematic"),
    "study": ("study", "study.yaml", "--jobs", "1", "--out", "new"),
    "resume": ("study", "resume", "stored", "--jobs", "1"),
    "tune": ("tune", "tuned"),
    "ros2": ("ros2", "drive", "--params", "params.yaml", "--reference", "none"),
}


@pytest.mark.parametrize(
    "words",
    [pytest.param(words, marks=[pytest.mark.long] * (name == "ros2"), id=name)
     for name, words in OPTIONS.items()],
)  # fmt: skip
def test_code_in_a_file_needs_permission_on_the_command_line(stranger, words):
    refused = omnidrive(*words, cwd=stranger.folder)
    assert refused.returncode == 2
    text = " ".join(refused.stderr.split())
    assert "code that is not installed" in text, text
    assert "--allow-code" in text
    assert ".yaml" in text
    assert not stranger.took_effect()
    omnidrive(*words, "--allow-code", cwd=stranger.folder)
    assert stranger.took_effect()


@pytest.mark.parametrize(
    "words",
    [
        ("run", "--controller", "law.py:Law", "--task", "step", "--plant", "kinematic"),
        ("study", "axis.yaml", "--set", "plant=law.py:Law", "--dry-run"),
        ("list", "controllers", "law.py:Law"),
    ],
)
def test_code_that_the_user_names_needs_no_other_permission(stranger, words):
    omnidrive(*words, cwd=stranger.folder)
    assert stranger.took_effect()


CODE_TEXT, OTHER_TEXT = "a.py:A", "10.0.0.1:23000"
LAW, HOST = {"type": CODE_TEXT, "host": OTHER_TEXT}, {"type": "pid", "host": OTHER_TEXT}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("plant", CODE_TEXT), ("plant", LAW), ("plant.type", CODE_TEXT),
        ("reference", LAW), ("reference.type", CODE_TEXT),
        ("controllers", ["pid", CODE_TEXT]), ("controllers", {"own": LAW, "host": HOST}),
        ("controllers.own", CODE_TEXT), ("controllers.a.b", LAW), ("controllers.a.type", CODE_TEXT),
        ("sensors", {"estimator": LAW}), ("sensors.estimator", CODE_TEXT),
        ("sensors.estimator.type", CODE_TEXT),
    ],
)  # fmt: skip
def test_code_in_a_value_is_found(path, value):
    assert [name for _, name in code_in(path, value)] == [CODE_TEXT]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("plant.host", OTHER_TEXT), ("plant", {"host": OTHER_TEXT}), ("plant.subtype", OTHER_TEXT),
        ("reference.file", OTHER_TEXT), ("controllers.own.host", OTHER_TEXT),
        ("controllers.own", {"host": OTHER_TEXT}), ("controllers", {"own": HOST}),
        ("sensors.estimator.host", OTHER_TEXT), ("map.source", OTHER_TEXT),
    ],
)  # fmt: skip
def test_text_with_a_colon_is_no_code_in_a_parameter(path, value):
    assert not list(code_in(path, value))


def _circle():
    return configure("references", "circle").make(
        ReferenceContext(named_robot("paper"), Pose(0.0, 0.0, 0.0))
    )


READERS = {
    "scenario": lambda s, **p: load_scenario(s.folder / "scenario.yaml", **p),
    "study": lambda s, **p: load_definition(s.folder / "study.yaml", **p),
    "axis": lambda s, **p: load_definition(s.folder / "axis.yaml", **p),
    "stored": lambda s, **p: load_study(s.folder / "stored", **p),
    "tuning": lambda s, **p: load_tuning(s.folder / "tuned", **p),
    "log": lambda s, **p: scenario_of_log(
        {f"{PREFIX}scenario.yaml": (s.folder / "scenario.yaml").read_bytes()}, **p
    ).__enter__(),
    "ros2 log": lambda s, **p: drive_of_log(
        {
            "parameters.yaml": parameters_file(DriveSettings(controller=s.law)),
            **reference_file(_circle(), 0.1),
        },
        named_robot("paper"),
        **p,
    ),
}


@pytest.mark.parametrize("name", READERS)
def test_code_in_a_file_needs_permission_in_python(stranger, name):
    with pytest.raises(InvalidInput, match=r"law\.py:Law.*--allow-code"):
        READERS[name](stranger)
    assert not stranger.took_effect()
    with suppress(OmnidriveError):  # a law is no plant, for example
        READERS[name](stranger, allow_code=True)
    assert stranger.took_effect()


def test_controller_file_needs_permission_whoever_names_it(stranger):
    with pytest.raises(ValueError, match="--allow-code"):
        small_scenario(controllers={"own": str(stranger.folder / "law.yaml")})
    assert not stranger.took_effect()


def test_arrays_are_not_unpickled(stranger):
    with pytest.raises(OmnidriveError):
        load_map(stranger.folder / "map.npy")
    assert not stranger.took_effect()


def test_stored_study_is_shown_without_its_code_and_names_what_it_needs(stranger):
    """What the program prints as the next command works as printed."""
    done = omnidrive("study", "status", "stored", cwd=stranger.folder)
    assert done.returncode == 2, "there is no store yet"
    words = ("--set", "controllers.own=law.py:Law", "--jobs", "1")
    first = omnidrive("study", "study.yaml", *words, "--out", "here", cwd=stranger.folder)
    assert first.returncode == 2, "the file names it, too"
    first = omnidrive("study", "study.yaml", "--allow-code", *words[2:], "--out", "here",
                      cwd=stranger.folder)  # fmt: skip
    assert first.returncode == 0, first.stderr
    assert stranger.took_effect()
    for words in (("status", "here"), ("export", "here", "--out", "t.csv"), ("report", "here")):
        done = omnidrive("study", *words, cwd=stranger.folder)
        assert done.returncode == 0, done.stderr
        assert not stranger.took_effect(), words
    facts = read_study(stranger.folder / "here").facts
    assert facts.command.endswith("study.yaml --allow-code --out repeated")


def test_unread_code_stays_unread_in_copies(stranger):
    unread = configure("controllers", stranger.law, {"a": 1}, allow_code=CodePermission.UNREAD)
    again = pickle.loads(pickle.dumps(unread))
    assert again == unread
    assert again.values == {"a": 1}
    with pytest.raises(OmnidriveError, match="was not imported"):
        again.make()
    assert not stranger.took_effect()


WORKERS = """
import sys
sys.path[:] = [each for each in sys.path if each]
import operator
from functools import partial
from omnidrive.execution.worker_pool import Call, WorkerPool
with WorkerPool(1, int) as pool:
    print(list(pool.outcomes([Call("sum", partial(operator.add, 1, 2))])))
"""
SHADOWED = ("threading", "loky", "numpy", "signal", "pickle", "sitecustomize", "selectors")


@pytest.mark.parametrize("words", [("-c", WORKERS), ("-m", "omnidrive", "list", "plants")])
def test_no_module_of_the_working_folder_replaces_one_of_python(tmp_path, words):
    for name in SHADOWED:
        if words[0] == "-c" or name in {"loky", "numpy"}:  # `python -m` itself imports others
            (tmp_path / f"{name}.py").write_text(f"open('mark-{name}', 'w')\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.glob("mark-*"))


def test_numba_file_of_the_working_folder_does_not_choose_the_cache(tmp_path):
    """Loading a kernel executes it."""
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: here\n", encoding="utf-8")
    code = "from omnidrive.compiled.cache_folder import usable_folder as f; print(f().path)"
    env = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True,
        check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "here" not in done.stdout


def test_terminal_sequences_in_names_are_escaped():
    assert encodable("a\x1b[2Jb\x9bc\r\n\td", "utf-8") == "a\\x1b[2Jb\\x9bc\\x0d\n\td"
