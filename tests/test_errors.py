"""Texts for messages."""

import re
import tomllib

from omnidrive.errors import failure_reason, kind_of, one_line, short_repr, suggestion
from tests.docs.blocks import ROOT


def test_suggestion_is_the_closest_name_or_a_list():
    assert suggestion("colour", ["size", "color"]) == "; did you mean 'color'?"
    assert suggestion("x", ["ab", "cd", "ef"], maximum=2) == "; there are ab, cd, ..."


def test_names_of_a_file_are_shown_as_one_short_line():
    assert suggestion("x", ["a\nb", "c" * 5000]) == f"; there are a\\nb, {'c' * 57}..."
    assert suggestion("c" * 4990, ["c" * 5000]) == f"; did you mean '{'c' * 57}...'?"


def test_text_is_escaped_to_one_line():
    assert one_line("a\nb\x1b") == "a\\nb\\x1b"
    assert one_line("x" * 400, 10) == "xxxxxxx..."


class Nameless:
    def __repr__(self):
        raise ValueError


def test_value_is_shown_in_one_short_line():
    assert short_repr(["a\n"]) == "['a\\n']"
    assert short_repr("x" * 400, 10) == "'xxxxxx..."
    assert short_repr(Nameless()) == "a Nameless"


def test_kind_of_a_value_has_its_article():
    kinds = [kind_of(each) for each in (None, 1, "", dict)]
    assert kinds == ["None", "an int", "a str", "the class dict"]


def test_reason_names_the_users_line():
    """The innermost line of the user's file is named, not that of a library it calls."""
    code = "import json\n\ndef step():\n    return json.loads(missing)\n\n"
    code += "def load():\n    json.loads('{')\n"
    own: dict = {}
    exec(compile(code, "/somewhere/mine.py", "exec"), own)
    reasons = []
    for name in ("step", "load"):
        try:
            own[name]()
        except Exception as error:
            reasons.append(failure_reason(error))
    assert reasons[0] == "NameError: name 'missing' is not defined (mine.py, line 4)"
    assert reasons[1].startswith("JSONDecodeError: ")
    assert reasons[1].endswith("(mine.py, line 7)")
    assert failure_reason(ValueError("x" * 1000)).endswith("...")


def test_packages_in_messages_are_those_of_the_extras():
    """A message names packages: extras need a copy of the repository, or an index."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {re.match(r"[\w-]+", each)[0] for some in project["optional-dependencies"].values()
              for each in some}  # fmt: skip
    named = set()
    for path in (ROOT / "src").rglob("*.py"):
        text = re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8"))
        for words in re.findall(r"pip install ([^\",;:\n]+)", text):
            named |= {re.match(r"[\w-]+", word.strip("'"))[0] for word in words.split()}
    assert named == extras


def test_suggestions_name_the_nearest_of_many_names_and_sort_sets():
    many = [f"name{k:02}" for k in range(20)] + ["longitude"]
    assert suggestion("quux", many, maximum=30) == f"; there are {', '.join(many)}"
    assert suggestion("titude of all things that are", many, maximum=2).startswith(
        "; there are longitude, name"
    )
    assert suggestion("xyzzy", {"b", "c", "a"}) == "; there are a, b, c"
