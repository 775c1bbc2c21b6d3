"""Shows commands as the command line does: examples as code, and what an argument is without Annotated[X, ...]."""

from __future__ import annotations

import re
from typing import Any

import griffe

EXAMPLES = re.compile(r"(?:^\$ .*\n?)+", re.MULTILINE)
"""Lines of a docstring that begin with a prompt."""


class Commands(griffe.Extension):
    """An extension of the reader of docstrings."""

    def on_function_instance(self, *, func: griffe.Function, **_: Any) -> None:
        """Change a function's docstring and the annotations of its parameters."""
        if func.docstring:
            func.docstring.value = EXAMPLES.sub(_code, func.docstring.value)
        for parameter in func.parameters:
            annotation = parameter.annotation
            if isinstance(annotation, griffe.ExprSubscript) and str(annotation.left) == "Annotated":
                parameter.annotation = next(iter(annotation.slice.elements))


def _code(examples: re.Match[str]) -> str:
    return "```bash\n" + re.sub(r"^\$ ", "", examples[0], flags=re.MULTILINE).rstrip() + "\n```\n"
