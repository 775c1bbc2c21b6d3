"""Shows what an argument is, without what the command line is told of it besides: Annotated[X, ...] as X."""

from __future__ import annotations

from typing import Any

import griffe


class PlainTypes(griffe.Extension):
    """An extension of the reader of docstrings."""

    def on_function_instance(self, *, func: griffe.Function, **_: Any) -> None:
        """Strip the annotations of a function's parameters."""
        for parameter in func.parameters:
            annotation = parameter.annotation
            if isinstance(annotation, griffe.ExprSubscript) and str(annotation.left) == "Annotated":
                parameter.annotation = next(iter(annotation.slice.elements))
