"""Code blocks of Markdown pages, and the marks that say how tests run them.

A mark is a comment on the line above a block, invisible on the page:

    <!-- test: long -->                     run only by `make test-long`
    <!-- test: with --plant kinematic -->   options that quick tests add to `run` and `compare`
    <!-- test: coppeliasim -->              a fake server replies at port 23000
    <!-- test: fails -->                    every command ends with a message, not with success
    <!-- test: not run, needs a display --> only options are checked, and Python code is parsed
    <!-- test: before
    code -->                                Python code that runs before the next block
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]

_FENCE = re.compile(
    r"^( *)```(\w*)(?: +title=\"([^\"]+)\")?[^\n`]*\n(.*?)^\1```$", re.MULTILINE | re.DOTALL
)
_MARK = re.compile(r"<!-- test: ((?:(?!-->).)*?) ?-->\s*\Z", re.DOTALL)


class Block(NamedTuple):
    """One fenced code block of a page."""

    page: Path
    line: int
    """Line of its first line of code."""
    language: str
    title: str
    """Name of the file that the block contains; empty: it is not a file."""
    text: str
    marks: tuple[str, ...]
    before: str
    """Hidden Python code that runs first."""

    @property
    def is_long(self) -> bool:
        return "long" in self.marks

    @property
    def options(self) -> list[str]:
        """Options that are added to `run` and `compare`."""
        return [o for mark in self.marks if mark.startswith("with ") for o in mark.split()[1:]]

    @property
    def is_run(self) -> bool:
        return not any(mark.startswith("not run") for mark in self.marks)


def blocks(page: Path) -> list[Block]:
    """Return the code blocks of a page, or the code cells of a notebook, in order."""
    if page.suffix == ".ipynb":
        cells = code_cells(page)
        return [
            Block(page, k, "python", "", "".join(c["source"]), (), "")
            for k, c in enumerate(cells, 1)
        ]
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _FENCE.finditer(text):
        indent, language, title, code = match.groups()
        marks, before, head = [], "", text[: match.start()]
        while mark := _MARK.search(head):
            kind, _, code_before = mark[1].partition("\n")
            if kind.strip() == "before":
                before = code_before + "\n" + before
            else:
                marks.append(mark[1].strip())
            head = head[: mark.start()]
        lines = [line.removeprefix(indent) for line in code.splitlines(keepends=True)]
        line = text.count("\n", 0, match.start(4)) + 1
        found.append(Block(page, line, language, title or "", "".join(lines), tuple(marks), before))
    return found


def code_cells(notebook: Path) -> list[dict]:
    """Return the code cells of a notebook, in order."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]
