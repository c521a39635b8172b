"""Output of the verbs: `--quiet`, notes, and messages of libraries."""

import json
import logging
import threading
import warnings
from importlib import import_module
from unittest.mock import Mock

import pytest

from omnidrive.cli import terminal
from omnidrive.cli.main import VERBS, load_verb
from omnidrive.cli.progress import LiveProgress, _Steps
from omnidrive.compiled.compilation import reported
from omnidrive.control.supervision import Event
from omnidrive.deploy.drive_state import EVENT
from omnidrive.errors import InvalidInput
from omnidrive.study import Study


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_the_option_quiet(verb):
    command = load_verb(verb)
    for each in getattr(command, "commands", {verb: command}).values():
        assert sum("--quiet" in param.opts for param in each.params) == 1


def test_quiet_prints_only_the_folder(command, tmp_path):
    study = ["compare", "--plant", "kinematic", "--tasks", "step", "--jobs", "1"]
    study += ["--figures", "none"]
    status, out, err = command(*study, "--controllers", "feedforward", "--out", "here", "--quiet")
    assert (status, err) == (0, "")
    assert out == "results: here (open here/report.html)\n"
    assert (tmp_path / "here" / "report.html").exists()


def test_quiet_json_prints_only_json(command):
    status, out, err = command("plan", "--json", "-q")
    assert (status, err) == (0, "")
    assert json.loads(out)["duration_s"] == 20.0


@pytest.fixture
def study(monkeypatch):
    """A study that is not simulated, with an event, a collision and an overlap."""
    run = Mock(task="track", log=Mock(events=[Event(1.0, "a push")]))
    made = Mock(
        spec=Study, logs=Mock(runs=[run]), facts=Mock(types={}), tables=[], timing={"plan": 1.0},
        collisions={"track": 2}, overlaps=["step"], definition=Mock(is_comparison=True),
    )  # fmt: skip

    def run_study(_scenario, folder, **_):
        folder.mkdir()
        (folder / "results.json").write_text('{"runs": []}')
        made.folder = folder
        return made

    def print_tables(_, *, full):
        print(f"{full=}")

    monkeypatch.setattr("omnidrive.study.run_study", run_study)
    monkeypatch.setattr("omnidrive.cli.studies.results.print_tables", print_tables)


@pytest.mark.usefixtures("study")
@pytest.mark.parametrize("verb", ["compare", "run"])
def test_json_full_and_quiet_of_a_study(command, verb):
    for option, full in (("", False), ("--full", True)):
        status, out, err = command(verb, *option.split(), "--out", f"plain{option}")
        assert status == 0
        assert f"{full=}" in out
        assert "1.00 s  a push" in out
        assert "collisions: track (2)" in err
        assert "overlaps an obstacle: step" in err
    status, out, err = command(verb, "--json", "--out", "json")
    assert (status, json.loads(out)) == (0, {"runs": []})
    assert "results: json (open" in err
    status, out, err = command(verb, "--quiet", "--out", "quiet")
    assert (status, err) == (0, "")
    assert [line for line in out.splitlines() if "full=" not in line] == [
        "results: quiet (open quiet/report.html)"
    ]


@pytest.mark.parametrize("verb", ["compare", "run", "plan"])
def test_compiling_is_noted_once(command, monkeypatch, verb):
    def compiling(*_, **__):
        for kernel in ("one", "another"):
            with reported(kernel):
                pass
        raise InvalidInput("enough")

    monkeypatch.setattr("omnidrive.scenario.plan_and_check", compiling)
    monkeypatch.setattr(import_module("omnidrive.study.run_study"), "plan_and_check", compiling)
    status, _, err = command(verb)
    assert (status, err.count("enough"), err.count("note: compiling")) == (2, 1, 1)


def test_quiet_prints_errors(command):
    status, out, err = command("plan", "none.yaml", "--quiet")
    assert (status, out) == (2, "")
    assert "cannot read the scenario none.yaml" in err


def test_quiet_applies_to_one_command(command):
    command("plan", "--quiet")
    assert "clearance" in command("plan")[1]


def test_messages_of_libraries_are_notes_printed_once(command, monkeypatch):
    def verb():
        for _ in range(3):
            logging.getLogger("library").warning("no font %s,\n  really", "STIX")
            warnings.warn("'a' is now called 'b'", FutureWarning, stacklevel=1)
        logging.getLogger("library").info("not shown")
        logging.getLogger("py.warnings").warning("for developers")

    monkeypatch.setattr("omnidrive.cli.warmup.warmup", verb)
    expected = "omnidrive: note: no font STIX, really\nomnidrive: note: 'a' is now called 'b'\n"
    assert command("warmup") == (0, "", expected)


def test_equal_events_are_printed_each_time(command, monkeypatch):
    def verb():
        for _ in range(2):
            logging.getLogger("omnidrive").warning("held", extra=EVENT)

    monkeypatch.setattr("omnidrive.cli.warmup.warmup", verb)
    assert command("warmup") == (0, "", 2 * "omnidrive: note: held\n")


def test_what_logs_does_not_wait_for_a_terminal_that_is_stopped(command, monkeypatch):
    goes_on, printed = threading.Event(), []

    def verb():
        with terminal.notes_in_a_thread():
            for k in range(3):
                logging.getLogger("omnidrive").warning("held %d", k)
            logging.getLogger("omnidrive").info("not shown")
            printed.append(len(terminal._Output.noted))  # of which none is out yet
            goes_on.set()
        logging.getLogger("omnidrive").warning("held again")

    def write(text):
        assert goes_on.wait(30.0)
        print(text)

    monkeypatch.setattr(terminal, "_print", write)
    monkeypatch.setattr("omnidrive.cli.warmup.warmup", verb)
    out = "".join(f"note: held {k}\n" for k in (0, 1, 2, "again"))
    assert command("warmup") == (0, out, "")
    assert printed[0] <= 1


def test_names_from_files_do_not_control_the_terminal(capsys, monkeypatch):
    monkeypatch.setattr(terminal._Output, "noted", set())
    name = "run\x1b[2J\nomnidrive: done"
    terminal.conclude(f"results: {name}")
    terminal.note(name)
    terminal.warn(name)
    out, err = capsys.readouterr()
    assert out == "results: run\\x1b[2J\\nomnidrive: done\n"
    shown = "run\\x1b[2J omnidrive: done"
    assert err == f"omnidrive: note: {shown}\nomnidrive: warning: {shown}\n"


def test_quiet_prints_no_notes(command, monkeypatch):
    monkeypatch.setattr(
        "omnidrive.cli.warmup.warmup", lambda: logging.getLogger("library").warning("no font")
    )
    assert command("warmup", "--quiet") == (0, "", "")


def test_a_part_with_an_unknown_number_of_steps_shows_none():
    progress = LiveProgress()
    counts = [column for column in progress._progress.columns if isinstance(column, _Steps)]

    def shown():
        return [str(column.render(progress._progress.tasks[-1])) for column in counts]

    progress.part("plan", 0)
    assert shown() == [""]
    progress._finish()
    assert shown() == [""]
    progress.part("simulate", 3)
    progress.done("one")
    assert shown() == ["1/3"]
