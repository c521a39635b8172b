"""Every command that the program, its reports and its pages print is accepted as printed."""

import ast
import re
import shlex

import pytest
import typer

from omnidrive.cli.main import VERBS, load_verb
from omnidrive.cli.new import _TRY
from omnidrive.study.study_folder import resume_command
from tests.docs.blocks import PAGES, ROOT

SOURCES = sorted((ROOT / "src").rglob("*.py"))
PAGE_PARTS = sorted((ROOT / "src").rglob("*.html"))
QUOTED = re.compile(r"`(omnidrive [^`]+)`")
IN_HTML = re.compile(r"<code>(omnidrive [^<]+)</code>")
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def strings(path):
    """Return the texts of a module without placeholders; neighbouring literals are one text."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def printed():
    """Return every printed command with its file."""
    for path in SOURCES:
        for text in strings(path):
            for command in QUOTED.findall(text):
                yield path.name, " ".join(command.split())
    for path in PAGE_PARTS:
        for command in IN_HTML.findall(path.read_text(encoding="utf-8")):
            yield path.name, command
    for path in PAGES:
        for command in QUOTED.findall(FENCED.sub("", path.read_text(encoding="utf-8"))):
            yield path.name, " ".join(command.split())
    for commands in _TRY.values():
        for command in commands:
            if command.startswith("omnidrive"):
                yield "new.py", command.format(file="a.py", name="Mine", test="test.py")


COMMANDS = sorted({(where, each) for where, each in printed() if "{" not in each})


def parse(words):
    """Parse a command as the program does, without running it."""
    if not words:
        return
    name, *rest = words
    assert name in VERBS, name
    command = load_verb(name)
    context = command.make_context(name, rest, resilient_parsing=len(rest) == 0)
    while hasattr(command, "commands") and rest:
        left = [*context._protected_args, *context.args]
        name, command, rest = command.resolve_command(context, left)
        if not rest:  # a verb is named
            return
        context = command.make_context(name, list(rest), parent=context)


@pytest.mark.parametrize(("where", "command"), COMMANDS)
def test_printed_commands_are_accepted(where, command):
    """N stands for a number, and an option at the end without its value is only named."""
    words = shlex.split(command.partition(" > ")[0])[1:]
    try:
        parse(["2" if word == "N" else word for word in words if word != "--help"])
    except typer.exceptions.TyperException as error:
        named = words[-1].startswith("--")
        if not (named and "requires an argument" in str(error)):
            raise AssertionError(f"{where}: {error}") from None


def test_a_refused_command_is_found():
    with pytest.raises(typer.exceptions.TyperException, match="No such option"):
        parse(shlex.split("study report runs/friction --nonsense"))


def test_folders_are_quoted():
    command = resume_command("my runs/it's", allow_code=True)
    words = shlex.split(command)
    assert words == ["omnidrive", "study", "resume", "my runs/it's", "--allow-code"]
    parse(words[1:])
