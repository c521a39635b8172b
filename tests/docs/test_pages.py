"""Every code block of the README and of the documentation runs."""

import json
import shutil
import subprocess
import sys

import pytest

from tests.docs.blocks import NOTEBOOKS, PAGES, ROOT, blocks, code_cells
from tests.docs.runner import check_output, commands
from tests.shared_data import shared

WITH_CODE = [*(page for page in PAGES if blocks(page)), *NOTEBOOKS]
MAPS = {
    "depot.yaml": ("depot.yaml", "maps/nav2/depot.yaml"),
    "depot.pgm": ("depot.yaml", "maps/nav2/depot.pgm"),
    "maze.map": ("maze.map", "maps/movingai/maze-32-32-4.map"),
    "maze.map.scen": ("maze.map", "maps/movingai/maze-32-32-4.map.scen"),
}
"""File that pages use: name that the page mentions, name in the reference data."""


def named(page):
    return str(page.relative_to(ROOT))


@pytest.fixture(scope="module")
def runner():
    """The process that runs pages."""
    command = [sys.executable, "-m", "tests.docs.runner"]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.stdin.close()


def run_page(runner, page, folder, *, is_long):
    code = "".join(block.text for block in blocks(page))
    for name, (mentioned, source) in MAPS.items():
        if mentioned in code:
            shutil.copy(shared(source), folder / name)
    print(json.dumps([str(page), str(folder), is_long]), file=runner.stdin, flush=True)
    answer = json.loads(runner.stdout.readline())
    if answer.startswith("skip: "):
        pytest.skip(answer)
    assert not answer, answer


SLOW = {
    "ros2.md", "study-results.md", "watching.md", "faults.md", "noise-and-estimation.md",
    "my-robot-my-map.md", "my-controller.md", "fuzzy.md", "robots.md",
}  # fmt: skip
"""Pages whose code takes many seconds."""


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=[pytest.mark.long] * (p.name in SLOW), id=named(p)) for p in WITH_CODE],
)
def test_the_code_of_a_page_runs(page, runner, tmp_path):
    run_page(runner, page, tmp_path, is_long=False)


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [p for p in WITH_CODE if any(b.is_long for b in blocks(p))], ids=named
)
def test_the_long_code_of_a_page_runs(page, runner, tmp_path):
    run_page(runner, page, tmp_path, is_long=True)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=named)
def test_a_notebook_is_stored_with_small_outputs(notebook):
    """`make notebook` executes it."""
    assert notebook.stat().st_size < 400_000
    for number, cell in enumerate(code_cells(notebook), 1):
        assert cell["execution_count"] == number
        assert [each["output_type"] for each in cell["outputs"]] == ["execute_result"]


def test_wrong_code_and_wrong_output_are_found(runner, tmp_path):
    """The tests above can fail."""
    page = tmp_path / "page.md"
    for text, reason in (
        ("```python\nprint(1)\n```\n```text\n2\n```", "the output lacks '2'"),
        ("```python\nundefined\n```", "NameError"),
        ("```sh\nomnidrive run --nonsense\n```", "nonsense"),
        ("<!-- test: fails -->\n```sh\nomnidrive --version\n```", "AssertionError"),
        ("```sh\npip install 'omnidrive[nonsense]'\n```", "nonsense"),
        ("```yaml\nnonsense: 1\n```", "nonsense"),
        ("```rust\nlet i;\n```", "cannot be tested"),
    ):
        page.write_text(text)
        with pytest.raises(AssertionError, match=reason):
            run_page(runner, page, tmp_path, is_long=False)


def test_output_is_compared_line_by_line():
    check_output("a ... d\n...\nz", "first\na b   c d\ny\nz\n")
    for wrong in ("z\na ... d", "a d", "a b c"):
        with pytest.raises(AssertionError, match="the output lacks"):
            check_output(wrong, "first\na b c d\ny\nz\n")


def test_commands_of_a_block():
    text = "make env  # comment\n\nomnidrive run \\\n  --out a && omnidrive list\n"
    assert commands(text) == ["make env", "omnidrive run --out a", "omnidrive list"]
