"""The notebooks run, and what is stored of them is what a reader should see."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from nbclient.exceptions import CellExecutionError

from notebooks.execute import NOTEBOOKS, execute, plain

LARGEST = 1_500_000
"""Of a notebook, bytes: code hosts stop showing larger ones at some point."""

MACHINE = re.compile(r"/(?:tmp|home|root|work|Users|var|opt)/|[A-Z]:\\\\|site-packages")
"""What paths of the machine that ran it look like."""


def read(path: Path) -> nbformat.NotebookNode:
    """Return a stored notebook."""
    return nbformat.read(path, as_version=4)


def code(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """Return its cells of code."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def words(output: nbformat.NotebookNode) -> str:
    """Return what an output says, without pictures and videos."""
    data = {kind: text for kind, text in output.get("data", {}).items() if not kind.startswith("image/")}
    return re.sub(r"base64,[^\"]*", "", " ".join([output.get("text", ""), *data.values()]))


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On small budgets, in an empty folder, without an error and without leaving a file; all output is shown."""
    monkeypatch.setenv("MINIGOLF_QUICK", "1")
    ran = execute(path, timeout=300)
    for now, stored in zip(code(ran), code(read(path)), strict=True):
        kinds = [output.output_type for output in now.outputs]
        assert "error" not in kinds
        assert ("display_data" in kinds) == ("display_data" in [output.output_type for output in stored.outputs])


@pytest.mark.parametrize(
    ("source", "error"),
    [("open('left.txt', 'w').close()", "left behind, there are left.txt"), ("1 / 0", "ZeroDivisionError")],
)
def test_what_a_run_must_not_do_is_an_error(source: str, error: str, tmp_path: Path) -> None:
    """To leave files, or to fail."""
    path = tmp_path / "one.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)]), path)
    with pytest.raises((RuntimeError, CellExecutionError), match=error):
        execute(path)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_stored_as_it_ran(path: Path) -> None:
    """Cells ran in order, each once; no errors, no warnings, nothing of the machine; small enough to be shown."""
    notebook = read(path)
    nbformat.validate(notebook)
    ran = [cell for cell in code(notebook) if cell.execution_count is not None]
    assert [cell.execution_count for cell in ran] == list(range(1, len(ran) + 1)) and ran == code(notebook)
    outputs = [output for cell in ran for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    for output in outputs:
        assert output.output_type != "error" and output.get("name") != "stderr"
        assert not MACHINE.search(words(output))
    assert path.stat().st_size < LARGEST
    assert nbformat.writes(plain(notebook)) + "\n" == path.read_text(), "make notebooks stores it anew"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_says_what_hosted_notebooks_need(path: Path) -> None:
    """In its first code, which is for them only: a line that installs, and a word on pictures without a screen."""
    first = code(read(path))[0]
    assert all(line.startswith("#") for line in first.source.splitlines()) and not first.outputs
    assert "%pip install" in first.source
    assert any(need in first.source for need in ("apt-get install -q libegl1 libgl1", "neither a screen nor a GPU"))


def test_all_are_here() -> None:
    """The README's four, in order."""
    assert [path.stem for path in NOTEBOOKS] == ["01_play_and_look", "02_physics", "03_train", "04_make_a_hole"]


def test_links_between_pages_lead_somewhere() -> None:
    """Files that the text links to exist."""
    for path in NOTEBOOKS:
        text = "\n".join(cell.source for cell in read(path).cells if cell.cell_type == "markdown")
        for target in re.findall(r"\]\(([^)#]+)\)", text):
            assert (path.parent / target).is_file(), f"{path.name} links to {target}"
