"""CITATION.cff: valid in the Citation File Format 1.2, and of the version of the project."""

import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
KEYS = {  # https://github.com/citation-file-format/citation-file-format/blob/1.2.0/schema-guide.md
    "abstract", "authors", "cff-version", "commit", "contact", "date-released", "doi",
    "identifiers", "keywords", "license", "license-url", "message", "preferred-citation",
    "references", "repository", "repository-artifact", "repository-code", "title", "type", "url",
    "version",
}  # fmt: skip


def test_citation_is_valid_and_of_this_version():
    data = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {"cff-version", "message", "title", "authors"} <= data.keys() <= KEYS
    assert data["cff-version"] == "1.2.0"
    assert data["type"] == "software"
    assert data["version"] == project["version"]
    assert data["license"] == project["license"]
    assert data["authors"] == project["authors"]
    for reference in data["references"]:
        assert {"type", "title", "authors"} <= reference.keys()
