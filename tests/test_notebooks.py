"""The notebooks run, and their stored outputs are complete, clean and small."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from nbclient.exceptions import CellExecutionError

from docs.hooks.notebook_markdown import notebook_to_markdown
from notebooks.execute import NOTEBOOK_PATHS, execute, normalize

MAX_NOTEBOOK_BYTES = 1_500_000
"""Largest size of a notebook; code hosts do not render much larger ones."""

MACHINE_PATH = re.compile(r"/(?:tmp|home|root|work|Users|var|opt)/|[A-Z]:\\\\|site-packages")
"""Paths of the machine that ran a notebook."""


def read(path: Path) -> nbformat.NotebookNode:
    """Return a stored notebook."""
    return nbformat.read(path, as_version=4)


def code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """Return the code cells of a notebook."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def output_text(output: nbformat.NotebookNode) -> str:
    """Return the text of an output, without images and videos."""
    data = {kind: text for kind, text in output.get("data", {}).items() if not kind.startswith("image/")}
    return re.sub(r"base64,[^\"]*", "", " ".join([output.get("text", ""), *data.values()]))


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("path", NOTEBOOK_PATHS, ids=lambda path: path.stem)
def test_notebook_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a small budget it runs without an error, leaves no file, and shows images where the stored one does."""
    monkeypatch.setenv("MINIGOLF_QUICK", "1")
    ran = execute(path, timeout=300)
    for executed, stored in zip(code_cells(ran), code_cells(read(path)), strict=True):
        kinds = [output.output_type for output in executed.outputs]
        assert "error" not in kinds
        assert ("display_data" in kinds) == ("display_data" in [output.output_type for output in stored.outputs])


@pytest.mark.parametrize(
    ("source", "error"),
    [("open('left.txt', 'w').close()", "left behind, there are left.txt"), ("1 / 0", "ZeroDivisionError")],
)
def test_execution_refuses_leftover_files_and_errors(source: str, error: str, tmp_path: Path) -> None:
    """A notebook that leaves a file or raises is an error."""
    path = tmp_path / "one.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)]), path)
    with pytest.raises((RuntimeError, CellExecutionError), match=error):
        execute(path)


@pytest.mark.parametrize("path", NOTEBOOK_PATHS, ids=lambda path: path.stem)
def test_stored_notebook_is_clean(path: Path) -> None:
    """All cells ran once, in order, without errors or warnings; no path of a machine is stored; the file is small."""
    notebook = read(path)
    nbformat.validate(notebook)
    executed = [cell for cell in code_cells(notebook) if cell.execution_count is not None]
    assert executed == code_cells(notebook)
    assert [cell.execution_count for cell in executed] == list(range(1, len(executed) + 1))
    outputs = [output for cell in executed for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    for output in outputs:
        assert output.output_type != "error" and output.get("name") != "stderr"
        assert not MACHINE_PATH.search(output_text(output))
    assert path.stat().st_size < MAX_NOTEBOOK_BYTES
    assert nbformat.writes(normalize(notebook)) + "\n" == path.read_text(), "store it again with `make notebooks`"


@pytest.mark.parametrize("path", NOTEBOOK_PATHS, ids=lambda path: path.stem)
def test_first_code_cell_has_instructions_for_hosted_notebooks(path: Path) -> None:
    """The cell is commented out; it has the installation and how to render without a display."""
    first = code_cells(read(path))[0]
    assert all(line.startswith("#") for line in first.source.splitlines()) and not first.outputs
    assert "%pip install" in first.source
    assert any(need in first.source for need in ("apt-get install -q libegl1 libgl1", "neither a display nor a GPU"))


def test_notebooks_are_complete() -> None:
    """The four notebooks that README lists exist, in that order."""
    assert [path.stem for path in NOTEBOOK_PATHS] == ["01_play_and_look", "02_physics", "03_train", "04_make_a_hole"]


def test_links_of_notebooks_exist() -> None:
    """Files that the text of a notebook links to exist."""
    for path in NOTEBOOK_PATHS:
        text = "\n".join(cell.source for cell in read(path).cells if cell.cell_type == "markdown")
        for target in re.findall(r"\]\(([^)#]+)\)", text):
            assert (path.parent / target).is_file(), f"{path.name} links to {target}"


@pytest.mark.parametrize("path", NOTEBOOK_PATHS, ids=lambda path: path.stem)
def test_site_page_has_all_text_code_and_outputs(path: Path) -> None:
    """The documentation site's page of a notebook has each cell, each printed text and each image."""
    notebook = read(path)
    page = notebook_to_markdown(path)
    assert all(cell.source in page for cell in notebook.cells)
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    assert all(output.text.rstrip() in page for output in outputs if output.output_type == "stream")
    images = [output for output in outputs if {"image/png", "image/jpeg"} & output.get("data", {}).keys()]
    assert page.count('<img class="output"') == len(images) > 0
