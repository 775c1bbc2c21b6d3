"""Command line of a sample program."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from typing import Any, TypeVar

from minigolf_env.apps.command_line import name_option, parse

Config = TypeVar("Config")


def run_program(main: Callable[[Config], object], config_class: type[Config], description: str | None) -> None:
    """Run a program with the configuration of its command line.

    Args:
        main: function that runs it.
        config_class: dataclass of its configuration, whose fields are the options.
        description: the help's text.

    Raises:
        SystemExit: the help was printed, an argument is invalid, or the program ended with a line of its own.
    """
    module = sys.modules["__main__"].__spec__
    config = parse(
        config_class,
        sys.argv[1:],
        prog=None if module is None else f"python -m {module.name}",
        description=description,
    )
    fields: Any = dataclasses.fields(config_class)  # type: ignore[arg-type]
    options = [field.name for field in fields if field.default is not dataclasses.MISSING]  # Others are positional.
    try:
        main(config)
    except SystemExit as stop:
        if not isinstance(stop.code, str):
            raise
        raise SystemExit(name_option(stop.code, options)) from stop
