"""Distributions with entry points, installed into a folder."""

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
