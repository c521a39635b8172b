"""HTML documents with their styles and scripts, from the templates of this package."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from importlib.resources import files

_EARLY = ("theme.js",)


def document(
    template: str, parts: Mapping[str, str], styles: Sequence[str], scripts: Sequence[str]
) -> str:
    """Return a whole HTML page; its content security policy permits only its own scripts.

    Args:
        template: Template of this package for all behind the header.
        parts: HTML of its placeholders ``{{NAME}}``, and of those of the header: ``kind`` of the
            page, ``title``, ``question`` (may be empty) and ``facts``.
        styles: Texts of its style sheets.
        scripts: Texts of the scripts at its end.
    """
    early = read_parts(_EARLY)
    frame = {
        "policy": content_policy([*early, *scripts], styles),
        "styles": "".join(f"<style>{text}</style>\n" for text in styles),
        "early": "".join(f"<script>{text}</script>\n" for text in early),
        "scripts": "".join(f"<script>{text}</script>\n" for text in scripts),
        "content": fill_template(template, parts),
    }
    return fill_template("frame.html", {**parts, **frame})


def fill_template(name: str, parts: Mapping[str, str]) -> str:
    """Return a template of this package with its placeholders ``{{NAME}}`` replaced.

    It is one pass, so that placeholders inside the parts are not replaced.
    """
    return re.sub(r"\{\{(\w+)\}\}", lambda hit: parts[hit[1]], read_parts((name,))[0])


def read_parts(names: Sequence[str]) -> list[str]:
    """Return the texts of files of this package."""
    folder = files("omnidrive.evaluation.page")
    return [folder.joinpath(name).read_text(encoding="utf-8") for name in names]


def content_policy(scripts: Sequence[str], styles: Sequence[str]) -> str:
    """Return the content security policy: scripts and styles by hash, no connections."""
    return (
        f"default-src 'none'; script-src {_hashes(scripts)}; style-src {_hashes(styles)}; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )


def _hashes(texts: Sequence[str]) -> str:
    digests = (b64encode(sha256(text.encode()).digest()).decode() for text in texts)
    return " ".join(f"'sha256-{digest}'" for digest in digests)
