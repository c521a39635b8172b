"""Execution of the code blocks of pages, each page in one folder and one Python namespace.

As a program it runs in a process of its own, as users' code does: without the type checks of the
tests, which make pages ten times slower, and once for many pages. It reads one page per line from
its standard input, and answers each with one line.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import os
import re
import runpy
import shlex
import sys
import tomllib
import traceback
from pathlib import Path

import yaml
from typer.testing import CliRunner

from omnidrive.cli.main import app, load_verb
from omnidrive.components import code as named_code
from omnidrive.errors import CannotDraw, OmnidriveError
from omnidrive.evaluation import study_report
from omnidrive.robot import named_robot
from omnidrive.scenario import load_scenario, paper_scenario
from omnidrive.scenario.scenario_file import scenario_data
from tests.docs.blocks import ROOT, Block, blocks
from tests.simulation.coppeliasim.fake_server import fake_server

FILES = {"yaml", "python", "text", "csv", "json", "toml", "xml"}
"""Languages of blocks that may be files."""

_EXTERNAL = {"cd", "docker", "git", "open", "ros2", "uv", "xdg-open"}
"""Commands of other programs, which tests do not run."""

_SIMULATING = {"run", "compare"}

write_figures = study_report.write_figures


class PageRunner:
    """Runs the blocks of one page; what they print is kept for the next block of output."""

    def __init__(self, folder: Path, *, is_long: bool):
        self.folder = folder
        self.is_long = is_long
        self.namespace = {"__name__": "__page__"}
        self.output = ""

    def run(self, block: Block) -> None:
        if block.before:
            self.python(block, block.before, block.line)
        if block.title:
            assert block.language in FILES, f"a block of {block.language!r} cannot be a file"
            path = self.folder / block.title
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            self.output = self.python(block, block.text, block.line)
        elif block.language == "sh":
            self.output = "".join(self.command(block, line) for line in commands(block.text))
        elif block.language == "text":
            check_output(block.text, self.output)
        elif block.language == "yaml":
            check_yaml(block.text, self.folder)
        elif block.language != "c":  # for firmware, which is not run here
            raise AssertionError(f"a block of {block.language or 'no language'!r} cannot be tested")

    def python(self, block: Block, code: str, line: int) -> str:
        """Execute Python code, or only parse it; errors show the line of the page."""
        program = compile("\n" * (line - 1) + code, str(block.page), "exec")
        if not block.is_run:
            return ""
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.ExitStack() as stack:
            if "coppeliasim" in block.marks:
                server = stack.enter_context(fake_server(named_robot("paper"), step=0.05))
                code = code.replace("23000", str(server.port))
                program = compile("\n" * (line - 1) + code, str(block.page), "exec")
            exec(program, self.namespace)
        return printed.getvalue()

    def command(self, block: Block, line: str) -> str:
        """Run one command line; return what it prints."""
        program, *words = shlex.split(line)
        if program == "omnidrive":
            return self.omnidrive(block, words)
        if program == "python":
            return self.script(words)
        if program == "make":
            makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
            assert re.search(rf"^{re.escape(words[0])}:", makefile, re.MULTILINE), words[0]
        elif program == "pip":
            check_extras(words)
        elif program == ".":
            assert words == [".venv/bin/activate"], line
        else:
            assert program in _EXTERNAL, f"unknown command: {line}"
        return ""

    def omnidrive(self, block: Block, words: list[str]) -> str:
        if not block.is_run:
            check_options(words)
            return ""
        if words and words[0] in _SIMULATING:
            words = [*words, *([] if self.is_long else block.options)]
            if words[0] == "compare" and "--jobs" not in words:
                words += ["--jobs", "1"]  # worker processes would import the package again
        named_code._allowed.clear()  # a command is a process of its own
        result = CliRunner().invoke(app, words, env={"COLUMNS": "110"})
        error = result.exception
        if "fails" in block.marks:
            assert isinstance(error, OmnidriveError) or result.exit_code == 2, words
            return f"{result.output}{error}\n"
        if error is not None and not isinstance(error, SystemExit):
            raise error
        assert result.exit_code == 0, f"{words}: {result.output}"
        return result.output

    def script(self, words: list[str]) -> str:
        """Run a script of the page, or one of the examples."""
        assert len(words) == 1, words
        path = self.folder / words[0]
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            runpy.run_path(str(path if path.exists() else ROOT / words[0]), run_name="__main__")
        return printed.getvalue()


def commands(text: str) -> list[str]:
    """Return the command lines of a block, without comments; a backslash continues a line."""
    joined = re.sub(r" *\\\n *", " ", text)
    parts = [
        part for line in joined.splitlines() for part in re.sub(r"(^|\s)#.*", "", line).split("&&")
    ]
    return [part.strip() for part in parts if part.strip()]


def check_output(expected: str, output: str) -> None:
    """Check that the lines are in the output, in order; `...` stands for any text."""
    lines = [" ".join(line.split()) for line in output.splitlines()]
    for line in expected.splitlines():
        wanted = re.escape(" ".join(line.split())).replace(re.escape("..."), ".*")
        while lines and not re.fullmatch(wanted, lines[0]):
            lines.pop(0)
        assert lines, f"the output lacks {line!r}:\n{output}"
        if wanted != ".*":
            lines.pop(0)


def check_yaml(text: str, folder) -> None:
    """Check that a fragment of YAML is a part of a scenario; the other parts are the paper's."""
    path = folder / "fragment.yaml"
    path.write_text(yaml.safe_dump({**scenario_data(paper_scenario()), **yaml.safe_load(text)}))
    load_scenario(path, allow_code=True)


def check_extras(words: list[str]) -> None:
    """Check that the extras in `pip install '.[EXTRA]'` exist."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for named in re.findall(r"\[(.+?)\]", " ".join(words)):
        for extra in named.split(","):
            assert extra in project["optional-dependencies"], extra


def check_options(words: list[str]) -> None:
    """Check the names of a verb and its options."""
    group = getattr(load_verb(words[0]), "commands", {})
    verb = words[: 2 if words[1:2] and words[1] in group else 1]
    help_text = CliRunner().invoke(app, [*verb, "--help"], env={"COLUMNS": "200"}).output
    for word in words[1:]:
        if word.startswith("--"):
            assert re.search(rf"{word}\b", help_text), word


def run_page(page: Path, folder: Path, *, is_long: bool) -> str:
    """Run the blocks of a page in a folder; return why it failed, or an empty text.

    Without long blocks, figures of studies are not drawn: they take most of the time, and have
    tests of their own.
    """
    os.chdir(folder)
    sys.path[0] = str(folder)  # as for a script in the folder
    before = set(sys.modules)
    try:
        return _run_blocks(page, folder, is_long=is_long)
    finally:
        for name in set(sys.modules) - before:
            if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
                del sys.modules[name]


def _run_blocks(page: Path, folder: Path, *, is_long: bool) -> str:
    study_report.write_figures = write_figures if is_long else lambda *_: ()
    runner = PageRunner(folder, is_long=is_long)
    for block in blocks(page):
        if block.is_long and not is_long:
            continue
        try:
            runner.run(block)
        except CannotDraw as error:
            return f"skip: {error}"
        except BaseException:
            return f"{page}:{block.line}\n{traceback.format_exc()}"
    return ""


if __name__ == "__main__":
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what pages print does not mix with the answers
    gc.freeze()
    gc.set_threshold(100_000)  # after 700 objects: a third of the time
    for line in sys.stdin:
        page, folder, is_long = json.loads(line)
        answer = run_page(Path(page), Path(folder), is_long=is_long)
        print(json.dumps(answer), file=answers, flush=True)
    os._exit(0)  # to free all objects takes seconds
