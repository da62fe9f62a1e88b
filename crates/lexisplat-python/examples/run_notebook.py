"""Runs a notebook and fails if a cell does: python run_notebook.py NOTEBOOK [--write]

With --write the outputs are kept in the notebook. Needs nbclient and ipykernel.
"""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

#: Longest that a cell may take, in seconds.
PATIENCE = 900


def main(path: Path, write: bool) -> None:
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=PATIENCE, kernel_name="python3").execute()
    pictures = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if "image/png" in output.get("data", {})
    ]
    if not pictures:
        raise SystemExit(f"{path}: no pictures were made")
    if write:
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)
        notebook.metadata.pop("language_info", None)
        nbformat.write(notebook, path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), "--write" in sys.argv[2:])
