"""Distributions with entry points in a folder, and Python in a process that finds them."""

import os
import subprocess
import sys
import textwrap


def install(folder, name, version, entry_points, code):
    """Write the module and the metadata of a distribution; `-` in its name is `_` in the module's.

    A folder on the search path of Python makes it an installed one.
    """
    module = name.replace("-", "_")
    info = folder / f"{module}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (info / "entry_points.txt").write_text(textwrap.dedent(entry_points))
    (folder / f"{module}.py").write_text(textwrap.dedent(code))


def environment_with(folder):
    """Return environment variables with which Python finds the distributions in a folder."""
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "200"}


WITHOUT_FIGURES = (
    "import sys; from omnidrive.evaluation import study_report;"
    "study_report.write_figures = lambda *_: ();"
    "from omnidrive.cli import main; sys.argv[0] = 'omnidrive'; main()"
)
"""Program that runs a command; figures take most of its time and have tests of their own."""


def run_python(environment, cwd, *arguments):
    """Run Python with some arguments, and return its exit status and output."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=environment, cwd=cwd, capture_output=True, text=True, check=False,
    )  # fmt: skip
