"""Every code block of the README and of the documentation runs."""

import shutil

import pytest

from omnidrive.errors import CannotDraw
from tests.docs.blocks import PAGES, ROOT, blocks
from tests.docs.runner import PageRunner
from tests.shared_data import shared

WITH_CODE = [page for page in PAGES if blocks(page) and page.name != "README.md"]
MAPS = {
    "depot.yaml": ("depot.yaml", "maps/nav2/depot.yaml"),
    "depot.pgm": ("depot.yaml", "maps/nav2/depot.pgm"),
    "maze.map": ("maze.map", "maps/movingai/maze-32-32-4.map"),
    "maze.map.scen": ("maze.map", "maps/movingai/maze-32-32-4.map.scen"),
}
"""File that pages use: name that the page mentions, name in the reference data."""


def named(page):
    return str(page.relative_to(ROOT))


def run_page(page, folder, monkeypatch, *, is_long):
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    runner = PageRunner(folder)
    for block in blocks(page):
        if is_long or not block.is_long:
            try:
                runner.run(block)
            except CannotDraw as error:
                pytest.skip(str(error))
            except BaseException as error:
                error.add_note(f"in the block at {named(page)}:{block.line}")
                raise


@pytest.fixture
def folder(tmp_path, request):
    """A folder with the maps that the page names."""
    code = "".join(block.text for block in blocks(request.getfixturevalue("page")))
    for name, (mentioned, source) in MAPS.items():
        if mentioned in code:
            shutil.copy(shared(source), tmp_path / name)
    return tmp_path


@pytest.mark.parametrize("page", WITH_CODE, ids=named)
def test_the_code_of_a_page_runs(page, folder, monkeypatch):
    run_page(page, folder, monkeypatch, is_long=False)


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [p for p in WITH_CODE if any(b.is_long for b in blocks(p))], ids=named
)
def test_the_long_code_of_a_page_runs(page, folder, monkeypatch):
    run_page(page, folder, monkeypatch, is_long=True)
