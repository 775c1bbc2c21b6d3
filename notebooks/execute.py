"""Runs the notebooks and stores what they show: ``python -m notebooks.execute``, or ``make notebooks``.

``MINIGOLF_QUICK=1`` runs them on small budgets, as the tests do.
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

FOLDER = Path(__file__).parent
NOTEBOOKS = tuple(sorted(FOLDER.glob("*.ipynb")))
COMPILING = "minigolf_env: compiling the physics"
"""How a line starts that only says that this machine had no compiled kernels yet."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    notebooks: tuple[Path, ...] = NOTEBOOKS
    timeout: int = 1800
    """Of a cell, s."""


def execute(path: Path, timeout: int = 1800) -> nbformat.NotebookNode:
    """Return a notebook with the outputs of a run in an empty folder, which is removed.

    The repository's modules are found wherever the run is. Nothing is kept that another run would not show: no times,
    no names of this machine's kernels.

    Args:
        path: of the notebook, which stays as it is.
        timeout: of a cell, s.

    Raises:
        CellExecutionError: a cell raised an error.
    """
    notebook = nbformat.read(path, as_version=4)
    paths = [str(FOLDER.parent), os.environ.get("PYTHONPATH", "")]
    # A notebook sets its own backend; one that the caller chose would show no pictures.
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=timeout,
            coalesce_streams=True,
            extra_arguments=["--log-level=ERROR"],  # Else a kernel warns of its sockets, which only this machine has.
            resources={"metadata": {"path": folder}},
        )
        client.execute(env=environment)
        left = sorted(path.name for path in Path(folder).iterdir())
    if left:
        raise RuntimeError(f"{path.name}: expected no files left behind, there are {', '.join(left)}.")
    return plain(notebook)


def plain(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Take out what differs from run to run or machine to machine, and return the notebook."""
    notebook.metadata = nbformat.from_dict(
        {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        }
    )
    for number, cell in enumerate(notebook.cells):
        cell.id, cell.metadata = f"cell-{number}", nbformat.from_dict({})
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if not output.get("text", "").startswith(COMPILING)]
            for output in cell.outputs:
                if "image/jpeg" in output.get("data", {}):  # A photograph: the same as .png is ten times as large.
                    output.data.pop("image/png", None)
    return notebook


def main(args: Args) -> None:
    """Run notebooks and store them with their outputs."""
    for path in tqdm(args.notebooks, "Notebooks"):
        nbformat.write(execute(path, args.timeout), path)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
