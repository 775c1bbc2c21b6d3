"""Formats the docstrings and signatures of commands as the command line shows them."""

from __future__ import annotations

import re
from typing import Any

import griffe

PROMPT_LINES = re.compile(r"(?:^\$ .*\n?)+", re.MULTILINE)
"""Consecutive lines that begin with a prompt."""


class Commands(griffe.Extension):
    """A griffe extension: examples become blocks of code, and Annotated[X, ...] becomes X."""

    def on_function_instance(self, *, func: griffe.Function, **_: Any) -> None:
        """Change a function's docstring and the annotations of its parameters."""
        if func.docstring:
            func.docstring.value = PROMPT_LINES.sub(_code_block, func.docstring.value)
        for parameter in func.parameters:
            annotation = parameter.annotation
            if isinstance(annotation, griffe.ExprSubscript) and str(annotation.left) == "Annotated":
                parameter.annotation = next(iter(annotation.slice.elements))


def _code_block(lines: re.Match[str]) -> str:
    return "```bash\n" + re.sub(r"^\$ ", "", lines[0], flags=re.MULTILINE).rstrip() + "\n```\n"
