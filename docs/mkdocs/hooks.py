"""Pages of the site that are made from the repository, and links between them.

README, contribution guide and changelog are pages of the site, with their links turned to it. The
Python API has one page per package. A source file that a page links to becomes a page as well.
Notebooks become pages with their stored outputs.
"""

import ast
import base64
import html
import json
import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File, InclusionLevel

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
PACKAGES = {
    "omnidrive": "The public names",
    "omnidrive.geometry": "Poses and twists",
    "omnidrive.robot": "Robots",
    "omnidrive.maps": "Maps",
    "omnidrive.planning": "Planning",
    "omnidrive.reference": "References",
    "omnidrive.fuzzy": "Fuzzy systems",
    "omnidrive.estimation": "State estimation",
    "omnidrive.control": "Controllers",
    "omnidrive.control.nmpc.holonomic": "Holonomic NMPC",
    "omnidrive.control.nmpc.unicycle": "Unicycle NMPC",
    "omnidrive.control.pid": "PID and fuzzy PID",
    "omnidrive.control.supervision": "Supervision",
    "omnidrive.simulation": "Simulation",
    "omnidrive.evaluation": "Evaluation",
    "omnidrive.evaluation.figures": "Figures",
    "omnidrive.visualization": "Films and viewer",
    "omnidrive.scenario": "Scenarios",
    "omnidrive.study": "Studies",
    "omnidrive.deploy": "On the robot",
    "omnidrive.ros2": "ROS 2",
    "omnidrive.gym": "Gymnasium",
    "omnidrive.components": "Components",
    "omnidrive.testing": "Checks of your own parts",
    "omnidrive.errors": "Errors",
}
_UNSEARCHED = "---\nsearch:\n  exclude: true\n---\n\n"  # the search finds documentation, not source
_LINK = re.compile(r"(?<=\]\()([^)\s]+)(?=\))")
_CODE = re.compile(r"^( *)```.*?^\1```$|`[^`\n]+`", re.DOTALL | re.MULTILINE)


def on_config(config):
    """List the pages of the API and the decisions in the navigation."""
    api = [{title: f"api/{name}.md"} for name, title in PACKAGES.items()]
    decisions = [f"decisions/{path.name}" for path in sorted((DOCS / "decisions").glob("*.md"))]
    config["nav"] = _filled(config["nav"], {"api": api, "decisions": decisions})
    return config


def _filled(nav, lists):
    """Return the navigation with the lists in place of their names."""
    if isinstance(nav, list):
        return [_filled(each, lists) for each in nav]
    if isinstance(nav, dict):
        return {title: _filled(each, lists) for title, each in nav.items()}
    return lists.get(nav, nav)


def on_files(files, config):
    """Add the pages that are made from other files."""
    made = {target: (ROOT / source).read_text("utf-8") for source, target in PAGES.items()}
    for notebook in sorted(DOCS.rglob("*.ipynb")):
        made[notebook.relative_to(DOCS).with_suffix(".md").as_posix()] = _notebook(notebook)
    for name, title in PACKAGES.items():
        made[f"api/{name}.md"] = f"# {title}\n\n{_api(name)}"
    texts = [*made.values(), *(path.read_text("utf-8") for path in sorted(DOCS.rglob("*.md")))]
    linked = {
        target
        for text in texts
        for link in _LINK.findall(text)
        if (target := _source(link.partition("#")[0]))
    }
    made |= {f"source/{target}.md": _source_page(target) for target in sorted(linked)}
    for target, content in made.items():
        listed = not target.startswith("source/")
        level = InclusionLevel.INCLUDED if listed else InclusionLevel.NOT_IN_NAV
        files.append(File.generated(config, target, content=content, inclusion=level))
    return files


def on_page_markdown(markdown, page, config, files):
    """Turn links to files of the repository to the pages of the site."""
    here = {target: source for source, target in PAGES.items()}.get(
        page.file.src_uri, f"docs/{page.file.src_uri}"
    )

    def turned(match):
        link, _, anchor = match[1].partition("#")
        if not link or "://" in link or link.startswith("mailto:"):
            return match[1]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(here), link))
        target = re.sub(r"\.ipynb$", ".md", target)
        uri = PAGES.get(target) or (
            target.removeprefix("docs/") if target.startswith("docs/") else f"source/{target}.md"
        )
        relative = posixpath.relpath(uri, posixpath.dirname(page.file.src_uri) or ".")
        return f"{relative}#{anchor}" if anchor else relative

    parts, end = [], 0
    for code in _CODE.finditer(markdown):  # code is left as it is, links with code as text too
        parts += [_LINK.sub(turned, markdown[end : code.start()]), code[0]]
        end = code.end()
    return "".join([*parts, _LINK.sub(turned, markdown[end:])])


def _source(link):
    """Return the path in the repository of a link to a source file or folder; else None."""
    path = link.lstrip("./")
    if "://" in link or path in PAGES or path.startswith("docs/") or not path:
        return None
    return path.rstrip("/") if (ROOT / path).exists() and not (DOCS / path).exists() else None


def _source_page(target):
    path = ROOT / target
    if path.is_dir():
        files = (
            each for each in sorted(path.rglob("*")) if each.suffix in {".py", ".pyi", ".yaml"}
        )
        rows = "\n".join(
            f"| `{each.relative_to(path).as_posix()}` | {_title(each)} |" for each in files
        )
        return f"{_UNSEARCHED}# {target}\n\n| file | content |\n|---|---|\n{rows}\n"
    language = {".py": "python", ".pyi": "python", ".md": "markdown"}.get(path.suffix, "text")
    return f"{_UNSEARCHED}# {target}\n\n````{language}\n{path.read_text('utf-8').rstrip()}\n````\n"


def _title(path):
    """Return the first line of the docstring of a module."""
    if path.suffix != ".py":
        return ""
    lines = (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").splitlines()
    return lines[0].replace("|", "\\|") if lines else ""


def _api(name):
    """Return the directives for the public names of a package, read from its source."""
    tree = _tree(name)
    names = _exported(tree)
    if name == "omnidrive":
        rows = "\n".join(f"| `od.{each}` | `{_definition(name, each)[0]}` |" for each in names)
        return (
            f"`import omnidrive as od` gives these names.\n\n| name | from |\n|---|---|\n{rows}\n"
        )
    if not names:
        return f"::: {name}\n    options:\n      show_root_heading: false\n"
    text = ast.get_docstring(_tree(name, "__init__.py")) or ""
    parts = []
    for each in names:
        where = _definition(name, each)
        path = ".".join(where)
        own = name == max((p for p in PACKAGES if _exports(p, where)), key=len)
        parts.append(f"::: {path}\n" if own else f"[`{each}`][{path}]\n")
    return "\n".join([text, "", *parts])


def _exports(package, definition):
    """Return whether the page of a package shows a definition."""
    name = definition[1]
    shown = package != "omnidrive" and name in _exported(_tree(package))
    return shown and _definition(package, name) == definition


def _tree(module, *sources):
    """Return the syntax tree of a module; for a package, that of its stub if it has one."""
    path = ROOT / "src" / module.replace(".", "/")
    for source in sources or ("__init__.pyi", "__init__.py"):
        if (path / source).exists():
            return ast.parse((path / source).read_text("utf-8"))
    file = path.with_suffix(".py")
    return ast.parse(file.read_text("utf-8")) if file.exists() else None


def _definition(module, name):
    """Return the module in which a name is defined, and its name there."""
    is_package = (ROOT / "src" / module.replace(".", "/")).is_dir()
    for node in _tree(module).body:
        if not isinstance(node, ast.ImportFrom):
            continue
        for alias in node.names:
            if (alias.asname or alias.name) != name:
                continue
            base = module.split(".")[: None if is_package else -1]
            base = base[: len(base) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            if source.startswith("omnidrive") and _tree(source) is not None:
                return _definition(source, alias.name)
    return module, name


def _exported(tree):
    """Return the names in `__all__`."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return sorted(ast.literal_eval(node.value), key=str.lower)
    return []


def _notebook(path):
    """Return a notebook as Markdown with its stored outputs."""
    parts = []
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(text)
            continue
        parts.append(f"```python\n{text}\n```")
        parts += [_output(output) for output in cell["outputs"]]
    return "\n\n".join(parts) + "\n"


def _output(output):
    """Return one output of a cell as HTML."""
    if "text" in output:
        return f"<pre>{html.escape(''.join(output['text']))}</pre>"
    data = output["data"]
    if "image/png" in data:
        image = "".join(data["image/png"]).replace("\n", "")
        base64.b64decode(image, validate=True)
        return f'<img alt="Figure" src="data:image/png;base64,{image}">'
    if "text/html" in data:
        return f"<div>{''.join(data['text/html'])}</div>"
    return f"<pre>{html.escape(''.join(data['text/plain']))}</pre>"
