"""Converts a notebook to a Markdown page: text, code, and the outputs that are stored in the notebook.

nbconvert would do the same, and brings a dozen packages.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat

ANSI_CODE = re.compile(r"\x1b\[[0-9;]*m")
"""A terminal's colour code."""

BLANK_LINES = re.compile(r"\n\s*\n")
"""Blank lines, which would end a block of HTML in Markdown."""

OUTPUT_TYPES = ("image/png", "image/jpeg", "text/html", "text/plain")
"""MIME types of outputs, in order of preference."""


def notebook_to_markdown(path: Path) -> str:
    """Return a notebook as Markdown.

    Args:
        path: the notebook, with stored outputs.
    """
    blocks = []
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "markdown":
            blocks.append(cell.source)
        elif cell.cell_type == "code":
            blocks.append(f"`````python\n{cell.source}\n`````")
            blocks += [_output_to_markdown(output) for output in cell.outputs]
    return "\n\n".join(blocks) + "\n"


def _output_to_markdown(output: nbformat.NotebookNode) -> str:
    """Return an output as HTML in one block; images and videos are data URLs."""
    if output.output_type == "stream":
        return _preformatted(output.text)
    data = output.get("data", {})
    for mime in OUTPUT_TYPES:
        if mime not in data:
            continue
        if mime.startswith("image/"):
            return f'<img class="output" alt="Output of the code" src="data:{mime};base64,{data[mime].strip()}">'
        if mime == "text/html":
            content = BLANK_LINES.sub("\n", data[mime])
            return f'<div class="output">{content}</div>'
        return _preformatted(data[mime])
    return ""


def _preformatted(text: str) -> str:
    """Return plain text as a block of code."""
    return f"`````text\n{ANSI_CODE.sub('', text).rstrip()}\n`````"
