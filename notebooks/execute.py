"""Runs the notebooks and stores their outputs: ``python -m notebooks.execute``, or ``make notebooks``.

``MINIGOLF_QUICK=1`` runs them with small budgets, as the tests do.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import nbformat
import tyro
from nbclient import NotebookClient
from tqdm import tqdm

NOTEBOOK_FOLDER = Path(__file__).parent
NOTEBOOK_PATHS = tuple(sorted(NOTEBOOK_FOLDER.glob("*.ipynb")))
COMPILATION_NOTICE = "minigolf_env: compiling the physics"
"""Beginning of the line that announces the compilation of the kernels."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    notebooks: tuple[Path, ...] = NOTEBOOK_PATHS
    """Paths of the notebooks."""
    timeout: int = 1800
    """Time limit of a cell, s."""


def execute(path: Path, timeout: int = 1800) -> nbformat.NotebookNode:
    """Return a notebook with the outputs of a run in an empty temporary folder.

    The repository's modules can be imported. Outputs that differ from run to run, such as times and the names of this
    machine's kernels, are removed.

    Args:
        path: the notebook; the file is not changed.
        timeout: time limit of a cell, s.

    Raises:
        CellExecutionError: a cell raised an error.
        RuntimeError: the notebook left files behind.
    """
    notebook = nbformat.read(path, as_version=4)
    paths = [str(NOTEBOOK_FOLDER.parent), os.environ.get("PYTHONPATH", "")]
    # A notebook sets its own backend; the caller's may display no figures.
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=timeout,
            coalesce_streams=True,
            extra_arguments=["--log-level=ERROR"],  # Else the kernel warns about its sockets.
            resources={"metadata": {"path": folder}},
        )
        client.execute(env=environment)
        left_files = sorted(path.name for path in Path(folder).iterdir())
    if left_files:
        raise RuntimeError(f"{path.name}: expected no files left behind, there are {', '.join(left_files)}.")
    return normalize(notebook)


def normalize(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Remove what differs between runs or machines, and return the notebook."""
    notebook.metadata = nbformat.from_dict(
        {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        }
    )
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number}"
        cell.metadata = nbformat.from_dict({})
        if cell.cell_type == "code":
            cell.outputs = [
                output for output in cell.outputs if not output.get("text", "").startswith(COMPILATION_NOTICE)
            ]
            for output in cell.outputs:
                if "image/jpeg" in output.get("data", {}):  # A rendered image: as .png it is ten times as large.
                    output.data.pop("image/png", None)
    return notebook


def main(args: Args) -> None:
    """Run the notebooks and store them with their outputs."""
    for path in tqdm(args.notebooks, "Notebooks"):
        nbformat.write(execute(path, args.timeout), path)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
