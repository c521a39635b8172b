"""Output of the verbs: `--quiet`, notes, and messages of libraries."""

import json
import logging
import warnings

import pytest

from omnidrive.cli import terminal
from omnidrive.cli.main import VERBS, load_verb, main
from omnidrive.cli.progress import LiveProgress, _Steps
from omnidrive.study.section import Renamed


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """Run the command in this process; return its status, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(terminal._Output, "noted", set())
    handlers = logging.getLogger().handlers[:]

    def run(*args):
        monkeypatch.setattr("sys.argv", ["omnidrive", *map(str, args)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    yield run
    logging.getLogger().handlers[:] = handlers
    terminal._set_quiet(False)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_the_option_quiet(verb):
    command = load_verb(verb)
    for each in getattr(command, "commands", {verb: command}).values():
        assert sum("--quiet" in param.opts for param in each.params) == 1


def test_quiet_prints_only_the_folder(command, tmp_path):
    study = ["compare", "--plant", "kinematic", "--tasks", "step", "--jobs", "1"]
    status, out, err = command(*study, "--controllers", "feedforward", "--out", "here", "--quiet")
    assert (status, err) == (0, "")
    assert out == "results: here (open here/report.html)\n"
    assert (tmp_path / "here" / "report.html").exists()


def test_quiet_json_prints_only_json(command):
    status, out, err = command("plan", "--json", "-q")
    assert (status, err) == (0, "")
    assert json.loads(out)["duration_s"] == 20.0


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
            warnings.warn("'a' is now called 'b'", Renamed, stacklevel=1)
        logging.getLogger("library").info("not shown")
        logging.getLogger("py.warnings").warning("for developers")

    monkeypatch.setattr("omnidrive.cli.warmup.warmup", verb)
    expected = "omnidrive: note: no font STIX, really\nomnidrive: note: 'a' is now called 'b'\n"
    assert command("warmup") == (0, "", expected)


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
