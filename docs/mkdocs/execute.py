"""Execute a notebook in place and store small outputs: `make notebook`."""

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient

path = Path(sys.argv[1])
notebook = nbformat.read(path, as_version=4)
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
with TemporaryDirectory() as folder:
    client = NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": folder}}
    )
    client.execute()
for cell in notebook.cells:
    cell.metadata = {}
    for output in cell.get("outputs", []):
        output.get("data", {}).pop("text/plain", None) if len(output.get("data", {})) > 1 else None
notebook.metadata = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}
}
nbformat.write(notebook, path)
print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
