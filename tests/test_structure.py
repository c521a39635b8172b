"""Structure of the package: no import circles, no long functions, one writer of files."""

import ast
from functools import cache
from pathlib import Path

import omnidrive

ROOT = Path(omnidrive.__file__).parent
FILES = sorted(ROOT.rglob("*.py"))
MAX_LINES = 60


def module(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module(path): path for path in FILES}


@cache
def nodes(path):
    """Return the nodes of the syntax tree of a file."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def imported(path):
    """Modules of the package that a file imports when it is loaded; also for types only."""
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in MODULES else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name in MODULES}


def test_modules_import_each_other_in_one_direction():
    """Packages' own ``__init__`` modules, which only re-export, are left out."""
    packages = {module(path) for path in FILES if path.name == "__init__.py"}
    graph = {name: imported(path) - packages for name, path in MODULES.items()}
    done, circles = set(), []

    def visit(name, trail):
        if name in trail:
            circles.append([*trail[trail.index(name) :], name])
        elif name not in done:
            for other in sorted(graph[name]):
                visit(other, [*trail, name])
            done.add(name)

    for name in sorted(graph.keys() - packages):
        visit(name, [])
    assert not circles


def test_functions_are_short():
    long = {
        f"{path.relative_to(ROOT)}:{node.lineno} {node.name}": length
        for path in FILES
        for node in nodes(path)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (length := node.end_lineno - node.lineno + 1) > MAX_LINES
    }
    assert not long


WRITERS = {
    "files/output_file.py": "the writer of all outputs",
    "compiled/cache_folder.py": "compiled kernels, which are checked when they are read",
    "visualization/video_file.py": "films, into the temporary file that the caller gives",
    "cli/main.py": "closed standard streams",
    "deploy/attached_files.py": "files of a log, in a folder that ends when they are read",
    "study/storage/store_opening.py": "second name of a damaged database, and its log",
    "execution/worker_pool.py": "messages between processes, in a folder that ends with them",
}
"""Files that write by themselves, and what."""


def writes_elsewhere(call):
    """Whether a call writes, renames or copies a file other than the temporary path ``part``."""
    match call.func:
        case ast.Attribute(value=ast.Name("part")):
            return False
        case ast.Attribute(attr="write_text" | "write_bytes"):
            return True
        case ast.Attribute(value=owner, attr="replace" | "rename"):
            return len(call.args) == 1 or ast.unparse(owner) == "os"  # not that of a text
        case ast.Attribute(attr="open" | "fdopen") | ast.Name("open"):
            modes = [a.value for a in call.args if isinstance(a, ast.Constant)]
            return any(isinstance(mode, str) and set(mode) & set("wax+") for mode in modes[:2])
        case ast.Name("copyfile"):
            return ast.unparse(call.args[-1]) != "part"
    return False


def test_outputs_are_written_by_one_writer():
    """Files are whole or absent after a power failure only if ``output_file`` writes them."""
    found = {
        str(path.relative_to(ROOT)): ast.unparse(node)[:60]
        for path in FILES
        for node in nodes(path)
        if isinstance(node, ast.Call) and writes_elsewhere(node)
    }
    assert found.keys() == WRITERS.keys(), found
