"""Links between pages: files and headings exist, and every page is in the site."""

import re
import tomllib

import pytest
import yaml

from omnidrive.scenario.scenario import DEFAULT_CONTROLLERS
from tests.docs.blocks import PAGES, ROOT
from tests.laws.one_file_laws import ONE_FILE_LAWS

LINKED = [*PAGES, ROOT / "CHANGELOG.md"]
CODE = re.compile(r"^( *)```.*?^\1```$|`[^`\n]+`", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]+)\)")


def anchors(page):
    """Anchors of the headings of a page, as GitHub and the site make them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
    headings = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", each).strip().lower().replace(" ", "-") for each in headings}


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_are_valid(page):
    """Files and headings exist; a link text that is a file name is that of its target."""
    for text, link in LINK.findall(page.read_text(encoding="utf-8")):
        if "://" in link or link.startswith("mailto:"):
            continue
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        assert target.exists(), link
        if text.strip("`").endswith(".py"):
            assert path.endswith(text.strip("`")), link
        if anchor:
            assert target.suffix == ".md", link
            assert anchor in anchors(target), link


def test_no_asterisk_is_taken_as_emphasis():
    """The asterisk of A* and Theta* is escaped: two of them in one paragraph would be emphasis."""
    for page in LINKED:
        text = CODE.sub("", page.read_text(encoding="utf-8"))
        assert not re.search(r"\b(A|Theta)\*", text), page


def test_the_readme_fits_on_a_landing_page():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 90


def _table(page):
    """Return the text of a page, and the rows of its table of results."""
    text = (ROOT / page).read_text(encoding="utf-8")
    table = [line[1:-1].split("|") for line in re.findall(r"^\|.*\|$", text, re.MULTILINE)]
    rows = [[cell.strip(" *") for cell in row] for row in table[2:]]
    assert len(rows) == len(DEFAULT_CONTROLLERS["recommended"]) + len(ONE_FILE_LAWS)
    return text, rows


def test_results_show_every_controller_in_both_presets():
    """And the sentence below: most of the difference between the best and PID is feedforward."""
    text, rows = _table("docs/tutorials/paper-study.md")
    errors = {name: list(map(float, numbers)) for name, _, *numbers in rows}
    assert len(errors) == len(rows)  # every controller once
    assert {len(numbers) for numbers in errors.values()} == {2 * 4}
    paper, recommended = 0, 4  # columns of the ME, 20 s
    said = re.search(
        r"between (\S+) m and (\S+) m is feedforward .*`feedforward` alone has it\s+\((\S+) m\), "
        r"and so do the fuzzy PIDs of the preset `recommended` \((\S+) m\)",
        text,
    )
    most, least, *others = map(float, said.groups())
    assert (most, least) == (errors["PID"][paper], errors["holonomic NMPC"][paper])
    assert others == [
        errors["feedforward"][paper], errors["interval type-2 fuzzy PID"][recommended],
    ]  # fmt: skip
    assert all(most - error > 0.9 * (most - least) for error in others)
    _, short = _table("README.md")
    for (name, said, *found), (full, states, *numbers) in zip(short, rows, strict=True):
        published = f"{1e3 * float(states):.1f}" if states else ""
        values = [float(numbers[k]) for k in (paper, recommended)]
        assert (name, said) == (full, published)
        assert found == [f"{1e3 * value:.1f}" for value in values]


def test_the_drawing_shows_every_package_in_order():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = project["tool"]["importlinter"]["contracts"][0]["layers"][1:]
    drawing = (ROOT / "docs/images/architecture.svg").read_text(encoding="utf-8")
    assert re.findall(r"<text x=\"36\"[^>]*>([^<]*)<", drawing) == layers


def test_every_page_is_in_the_navigation_of_the_site():
    """Pages made from other files are not checked here, but by `make docs`."""
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = set(re.findall(r"[\w./-]+\.md", str(yaml.safe_load(config)["nav"])))
    pages = {
        str(page.relative_to(ROOT / "docs")) for page in PAGES if ROOT / "docs" in page.parents
    }
    assert {page for page in pages if not page.startswith("decisions/")} <= listed


def test_the_site_loads_nothing_from_the_network():
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert yaml.safe_load(config)["theme"]["font"] is False
    assert "://" not in config
    for page in PAGES:
        text = CODE.sub("", page.read_text(encoding="utf-8"))
        assert not re.search(r"!\[[^\]]*\]\(\w+://|<(script|img|link|iframe)\b", text), page
